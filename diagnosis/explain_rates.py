"""Causes of the noise, losses and outliers: one channel after the other, by odds and by laws.

Outliers beyond the working range come as losses, and what darkens the light loses readings before
it adds noise: each channel is looked at under the laws of those before it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from diagnosis.claims.outliers_of_one_size import one_size_mm
from diagnosis.evidence.assess import assessed_rates
from diagnosis.evidence.explained_rates import explained_shares
from diagnosis.evidence.noise_and_loss_baselines import beside_baselines
from diagnosis.evidence.noise_and_loss_channels import Channel
from diagnosis.evidence.reported_causes import (
    Cause,
    Unexplained,
    not_yet_named,
    offered_in_turn,
    reported,
    unnamed,
    usual_components,
)
from diagnosis.evidence.seen import Whitening, channel_seen
from diagnosis.explanation import Progress, State, completed, fitted_part
from diagnosis.fields import Field
from diagnosis.noise.noise_model import NoiseModel
from diagnosis.physics.joint_fit import fit_laws
from diagnosis.settings import SETTINGS

IN_TURN = ("outliers", "missing", "scale")


def explain_rates(
    state: State,
    baseline_channels: Mapping[str, Channel],
    scales: Mapping[str, Field],
    noise: NoiseModel,
    *,
    withheld: frozenset[str],
    notes: list[str],
    progress: Progress,
) -> tuple[State, list[Unexplained], list[Unexplained]]:
    """Find the causes of what departs in noise, losses and outliers, and fit their laws.

    Parameters
    ----------
    baseline_channels : of the baselines, by name
    scales : what a good instrument has of each component
    withheld : names of effects that must not be considered

    Returns
    -------
    the explanation with them; what has no name; what good instruments have as well
    """
    unexplained: list[Unexplained] = []
    usual: list[Unexplained] = []
    whole = _whitened(state, noise)
    for name in IN_TURN:
        channels = _seen(name, whole, state, baseline_channels)
        for _ in range(SETTINGS.most_causes):
            found = assessed_rates(channels, scales, withheld=withheld)
            named, nameless = reported(found)
            new, alike = _by_chance(not_yet_named(named, state.names), state, noise)
            if not new:
                break
            # one law at a time: what it leaves isn't what the others would have to explain
            before = channels
            for cause in offered_in_turn(new[0]):
                trial = _with_law(state, cause, noise, notes, progress)
                under = _whitened(trial, noise)
                channels = _seen(name, under, trial, baseline_channels)
                shares = explained_shares(found.rates, before, channels)
                explained = shares.get((cause.channel, cause.name), 1.0)
                if explained >= SETTINGS.explained_share:
                    break
            else:
                nameless = [*unnamed(new[:1]), *nameless]
                break
            state, whole = trial, under
        unexplained += [*alike, *nameless]
        usual += usual_components(found)
    return state, unexplained, usual


def _whitened(state: State, noise: NoiseModel) -> Whitening:
    return Whitening.under(state.model, fitted_part(state.patches, noise))


def _seen(
    name: str, whole: Whitening, state: State, baseline_channels: Mapping[str, Channel]
) -> list[Channel]:
    """Look at one channel under the model, beside what baselines have of it; [] with nothing."""
    channel = channel_seen(name, whole, state.first)
    if channel is None:
        return []
    usual = [baseline_channels[name]] if name in baseline_channels else []
    return beside_baselines([channel], usual)


def _with_law(
    state: State,
    new: Cause,
    noise: NoiseModel,
    notes: list[str],
    progress: Progress,
) -> State:
    """Fit the law of a cause beside those before it."""
    progress(f"fitting {new.name}")
    recorded, patches = completed(
        state.recorded, state.patches, [new], noise, state.model, notes
    )
    model, fitted = fit_laws([new], fitted_part(patches, noise), state.model)
    return replace(
        state, recorded=recorded, patches=patches, model=model, causes=(*state.causes, *fitted)
    )


def _by_chance(
    new: Sequence[Cause], state: State, noise: NoiseModel
) -> tuple[Sequence[Cause], list[Unexplained]]:
    """Take the names of outliers back that all lie equally far off: no chance makes such."""
    outliers = [c for c in new if c.channel == "outliers"]
    off = one_size_mm(fitted_part(state.patches, noise), state.model) if outliers else None
    if off is None:
        return new, []
    what = f"outliers that all lie {1e3 * off:+.0f} µm off"
    alike = [replace(c.unnamed(), component=what) for c in outliers]
    return [c for c in new if c not in outliers], alike
