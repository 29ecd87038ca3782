"""States passed while loading, from which unloading starts."""

import pytest
import torch

from tacdata.skin.solve.configuration import Unknowns
from tacdata.skin.solve.loading_states import LoadingStates

NODES, MEMBERS = 5, 3
BOTH = torch.tensor([True, True, False])


def field(*scales):
    """Unknowns of every member: fixed ones times its scale, exact in single precision; of two contacts."""
    base = torch.arange(NODES * 3, dtype=torch.float64).reshape(NODES, 3, 1) - 4
    size = torch.tensor(scales, dtype=torch.float64)
    return Unknowns(base * size, tuple((base[:count, 0] + count) * size for count in (4, 2)))


def same(one, other, exact=False):
    pairs = zip((one.u, *one.multipliers), (other.u, *other.multipliers), strict=True)
    return all(torch.equal(a, b) if exact else torch.allclose(a, b) for a, b in pairs)


def depths(*values):
    return torch.tensor(values, dtype=torch.float64)


@pytest.fixture
def passed():
    """Members 0 and 1 in use, 2 idle."""
    made = LoadingStates(field(*[0] * MEMBERS))
    made.forget(BOTH)
    return made


def test_at_first_everything_is_flat(passed):
    assert passed.deepest[:2].tolist() == [0.0, 0.0]
    assert same(passed.at(depths(0.0, 0.3, 0.1)), field(0, 0, 0), exact=True)


def test_states_are_found_again_at_their_depths_and_interpolated_between(passed):
    passed.add(BOTH, depths(0.25, 0.5, 0.0), field(1, 10, 0))
    passed.add(BOTH, depths(0.5, 0.75, 0.0), field(3, 20, 0))
    assert passed.deepest[:2].tolist() == [0.5, 0.75]
    assert same(passed.at(depths(0.25, 0.75, 0.0)), field(1, 20, 0), exact=True)
    assert same(passed.at(depths(0.375, 0.625, 0.0)), field(2, 15, 0))
    # Below the first state: between it and the flat skin.
    assert same(passed.at(depths(0.125, 0.0, 0.0)), field(0.5, 0, 0))
    found = passed.at(depths(0.1, 0.1, 0.1))
    assert {part.dtype for part in (found.u, *found.multipliers)} == {torch.float64}


def test_the_way_back_starts_from_the_way_down_and_what_friction_left(passed):
    passed.add(BOTH, depths(0.25, 0.5, 0.0), field(1, 10, 0))
    passed.add(BOTH, depths(0.5, 0.75, 0.0), field(3, 20, 0))
    now, depth, attempt = field(3.5, 22, 0), depths(0.5, 0.75, 0.0), depths(0.25, 0.0, 0.0)
    assert same(passed.back(now, depth, attempt, leaves=True), field(1.5, 0, 0)), "flat where the shape has left"
    assert same(passed.back(now, depth, attempt, leaves=False), field(1.5, 2, 0)), "unless it sticks"


def test_each_member_has_its_own_number_of_states(passed):
    for k in range(1, 4):
        passed.add(torch.tensor([True, False, False]), depths(0.1 * k, 0.9, 0.9), field(k, 7, 7))
    passed.add(torch.tensor([False, True, False]), depths(0.9, 0.4, 0.9), field(7, 4, 7))
    assert passed.deepest[:2].tolist() == pytest.approx([0.3, 0.4])
    assert same(passed.at(depths(0.25, 0.2, 0.0)), field(2.5, 2, 0))


def test_room_grows_with_the_states(passed):
    for k in range(1, 21):
        passed.add(BOTH, depths(0.05 * k, 0.1 * k, 0.0), field(k, -k, 0))
    assert same(passed.at(depths(0.525, 0.55, 0.0)), field(10.5, -5.5, 0))
    assert same(passed.at(depths(1.0, 2.0, 0.0)), field(20, -20, 0))


def test_only_deeper_states_are_kept(passed):
    passed.add(BOTH, depths(0.5, 0.5, 0.0), field(1, 1, 0))
    passed.add(BOTH, depths(0.5, 0.25, 0.0), field(9, 9, 0))
    assert same(passed.at(depths(0.5, 0.5, 0.0)), field(1, 1, 0), exact=True)
    assert same(passed.at(depths(0.25, 0.25, 0.0)), field(0.5, 0.5, 0))


def test_a_new_press_forgets_the_old_one_and_its_neighbour_does_not(passed):
    for k in range(1, 6):
        passed.add(BOTH, depths(0.1 * k, 0.1 * k, 0.0), field(k, k, 0))
    passed.forget(torch.tensor([True, False, False]))
    assert passed.deepest[:2].tolist() == pytest.approx([0.0, 0.5])
    assert same(passed.at(depths(0.3, 0.3, 0.0)), field(0, 3, 0))
    passed.add(torch.tensor([True, False, False]), depths(0.4, 0.0, 0.0), field(8, 0, 0))
    assert same(passed.at(depths(0.1, 0.5, 0.0)), field(2, 5, 0))


def test_an_idle_member_is_no_number_nowhere(passed):
    passed.add(BOTH, depths(0.5, 0.5, 0.0), field(1, 1, 0))
    found = passed.at(depths(0.1, 0.1, 0.0))
    assert all(torch.isfinite(part).all() for part in (found.u, *found.multipliers))


def test_members_that_are_kept_keep_their_states(passed):
    passed.add(BOTH, depths(0.25, 0.5, 0.0), field(1, 10, 0))
    passed.add(BOTH, depths(0.5, 0.75, 0.0), field(3, 20, 0))
    passed.keep(torch.tensor([1, 2]))
    assert passed.deepest[0].item() == 0.75
    assert torch.equal(passed.at(depths(0.625, 0.0)).multipliers[1][:, 0], field(0, 15, 0).multipliers[1][:, 1])
