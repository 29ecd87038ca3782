"""Newton steps that changed the contact's status are told apart from those that only balanced forces."""

import pytest
import torch

from tacdata.indenters.sphere import Sphere
from tacdata.skin.press import PressRequest
from tacdata.skin.solve.contact_status import ContactStatus
from tacdata.skin.solve.load_path import LoadPath


class Surface:
    """Its status is what a test says."""

    def status(self, now, friction):
        return now


def test_a_member_has_changed_where_any_node_of_any_contact_has():
    status, friction = ContactStatus([Surface(), Surface()]), torch.full((3,), 0.2)
    first, second = torch.tensor([[0, 1, 2], [0, 1, 2]]), torch.tensor([[0, 0, 1]])
    assert status.changed([first, second], friction).tolist() == [False] * 3, "nothing was noted before"
    status.note([first, second], friction)
    slipped, opened = first.clone(), second.clone()
    slipped[1, 1], opened[0, 2] = 2, 0
    assert status.changed([first, second], friction).tolist() == [False, False, False]
    assert status.changed([slipped, second], friction).tolist() == [False, True, False]
    assert status.changed([slipped, opened], friction).tolist() == [False, True, True]
    status.keep(torch.tensor([2, 0]))
    assert status.changed([slipped[:, [2, 0]], opened[:, [2, 0]]], friction[:2]).tolist() == [True, False]


def test_a_path_counts_steps_and_not_starts():
    path = LoadPath((0.2,), 0.25, "a press")
    path.status_changed()
    assert path.changed == 0, "no step was taken yet"
    for change in (True, False, True):
        path.stepped()
        if change:
            path.status_changed()
    assert path.changed == 2 and path.taken() == 3
    assert path.changed == path.spent == 0


@pytest.mark.parametrize("name", ["slab", "rough_slab"])
def test_a_solution_tells_both_kinds_of_steps(name, request):
    model = request.getfixturevalue(name)
    solution = model.solve(PressRequest(Sphere(2.0), 0.0, 0.0, 0.0, (0.0, 0.25, 0.5, 0.25)))
    both = solution.status_steps + solution.equilibrium_steps
    assert both.sum() == solution.provenance["parameters"]["newton"]
    assert (solution.status_steps[1:3] >= 1).all(), "nodes are reached at every depth"
    assert (solution.equilibrium_steps >= 0).all() and solution.equilibrium_steps.sum() > 0
