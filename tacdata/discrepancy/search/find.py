"""The search for missing effects, step by step."""

from __future__ import annotations

from tacdata.discrepancy.model.setting import Setting
from tacdata.discrepancy.noise.null_model import null_model
from tacdata.discrepancy.search.detection_limits import detection_limits
from tacdata.discrepancy.search.elimination import Answer, eliminate
from tacdata.discrepancy.search.findings import STEPS, Findings, FoundEffect
from tacdata.discrepancy.search.fits import channel_gains, gains_of_halves
from tacdata.discrepancy.search.gate import Gate, gate
from tacdata.discrepancy.search.leftovers import Leftovers, leftovers
from tacdata.discrepancy.search.problem import Problem, prepare
from tacdata.discrepancy.search.race import Note, Selection, race, start


def find(setting: Setting, note: Note = lambda text: None, until: str = "decide") -> Findings:
    """Find which effects a model lacks.

    Noise and nuisances, regressors, gate, race (forward selection), backward elimination with rivals, leftovers.

    From the gate on, an interrupt ends the search and keeps the findings so far.

    Args:
        setting: Recordings, response, library.
        note: Called with each step.
        until: The last step to make, one of `STEPS`.
    """
    note("gate: is there a gap")
    # Noise is estimated once, without effects. An answer must not choose the noise that it is tested by.
    gated = gate(prepare(setting, null_model(setting)))
    least_p = min(gated.tests.p.min(initial=1.0), gated.tests.p_generic)
    note(f"{'there is a gap' if gated.gap else 'there is no gap'}, p = {least_p:.3f}")
    selection = start(setting, gated)
    try:
        if gated.gap and until in STEPS[2:]:
            for added in race(setting, selection, note):
                selection = added
        if until == "decide":
            note("rivals and leftovers")
            # With the answer's noise only the residual is examined: nothing is tried there.
            placed = selection.model.placed
            problem = prepare(setting, selection.null, tested=False, among=()) if placed else gated.problem
            return _findings(gated, selection, problem, eliminate(setting, selection), until)
    except KeyboardInterrupt:
        until = "fit" if selection.model.placed else "locate"
        note(f"stopped after {until}")
    return _findings(gated, selection, gated.problem, _fitted(selection), until)


def _fitted(selection: Selection) -> Answer:
    """Return the effects that fit best, without necessity and rivals."""
    model = selection.model
    fitted_effects = tuple(FoundEffect(p, *model.errors(k), (), {}, 0.0) for k, p in enumerate(model.placed))
    return Answer(fitted_effects, model, selection.problem)


def _findings(gated: Gate, selection: Selection, problem: Problem, answer: Answer, until: str) -> Findings:
    """Put together the findings.

    Args:
        gated: The model as it was given, with its own noise.
        selection: With the noise of the answer.
        problem: The model as it was given, with that noise.
        answer: The effects.
        until: The last step.
    """
    nothing, model, final = selection.nothing, answer.model, answer.problem
    return Findings(
        gap=gated.gap,
        tests=gated.tests,
        effects=answer.findings,
        left=leftovers(final) if until == "decide" else Leftovers(0.0, 0.0),
        explained=nothing.loss - model.loss,
        energy=(nothing.energy, model.energy),
        values=problem.grams.rows,
        given=gated.problem,
        problem=problem,
        final=final,
        limits=detection_limits(final),
        gains=channel_gains(final),
        halves=gains_of_halves(final),
        until=until,
        comparisons=answer.comparisons,
        path=tuple(effect.name for effect, _ in selection.explained),
    )
