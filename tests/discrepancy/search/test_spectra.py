"""Two mechanisms of linear memory are held against each other by all mixtures of times, not by one law of each."""

import numpy as np
import pytest
from pressing import course

from tacdata.chain import predict
from tacdata.discrepancy.model.fitted_response import FittedResponse
from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.regressors.spectrum import TIMES, spectrum
from tacdata.discrepancy.search.gauss_newton import refine
from tacdata.discrepancy.search.j_test import j_statistic
from tacdata.discrepancy.search.rivals import RIVAL_Z, Spectra
from tacdata.effects import Placed, load

RELAXATION, FLUID = load("relaxation"), load("poroelasticity")
MIXTURE = ((0.1, 0.25), (0.7, 0.3), (5.0, 0.45))
"""As wide as that of a gel, for a skin that may be none."""


def compared(by_radius):
    """Return by how much relaxation is ahead of poroelasticity, by their laws and by their spectra."""
    made = course(seed=1, radii=(2.0, 4.0), times=MIXTURE, relaxed=0.03, by_radius=by_radius)
    setting = Setting(made, FittedResponse(made), [RELAXATION, FLUID])
    null = null_model(setting)
    laws = [
        refine(setting, [Placed(law, {"f": np.array(0.01), "tau": np.array(2.0)})], null) for law in (RELAXATION, FLUID)
    ]
    spectra = Spectra(setting, refine(setting, [], null), null, {})
    return j_statistic(laws[0], laws[1], {}), spectra.compared(RELAXATION, FLUID)[0]


def test_a_skin_that_relaxes_as_a_gel_does_but_alike_under_both_tools_is_no_gel():
    by_law, by_spectrum = compared(0.0)
    assert by_law < -RIVAL_Z, "one time is too few: the other mechanism is ahead"
    assert by_spectrum > RIVAL_Z


def test_times_that_go_with_the_radius_are_those_of_a_gel():
    assert compared(1.0)[1] < -RIVAL_Z


def test_what_goes_with_the_radius_alike_is_compared_by_laws():
    assert Spectra.both(RELAXATION, FLUID) and Spectra.both(FLUID, load("nonlinear_relaxation"))
    assert not Spectra.both(RELAXATION, load("power_creep")) and not Spectra.both(FLUID, load("creep"))
    assert not Spectra.both(load("relaxation_read"), FLUID), "loads are not known"


@pytest.mark.parametrize("name", ["relaxation", "nonlinear_relaxation"])
def test_a_law_is_a_point_of_its_spectrum(name):
    made, law = course(seed=2), load(name)
    setting = Setting(made, FittedResponse(made), [])
    one = Placed(law, {"f": np.array(0.05), "tau": np.array(TIMES[3])})
    whole = spectrum(law, 0.0)
    same = Placed(whole.effect, {f"f{k}": np.array(0.05 * (k == 3)) for k in range(len(TIMES))})
    said = [predict(made, setting.response, [placed]).signal for placed in (one, same)]
    assert said[0] == pytest.approx(said[1], rel=1e-12)
    assert np.abs(said[0] - predict(made, setting.response, []).signal).max() > 1.0
