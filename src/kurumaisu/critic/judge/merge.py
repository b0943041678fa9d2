# SPDX-License-Identifier: BSD-3-Clause
"""One verdict of what the drives and what the scans say."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Set
from dataclasses import replace
from operator import itemgetter

from kurumaisu import effects
from kurumaisu.critic.experiment.design import LISTED_IDS
from kurumaisu.critic.heldout.materiality import CERTAIN, NO_NOISE, confirmed
from kurumaisu.critic.judge.sentences import named_causes, wrong_data
from kurumaisu.critic.values.criticism import (
    UNKNOWN_SCATTER,
    UNRESOLVED,
    UNRESOLVED_P,
    Criticism,
    LaserFinding,
    Pictures,
    Settings,
    StandIn,
)
from kurumaisu.critic.values.verdict import ChannelGain, Kind, Unknown, Verdict

_NOTHING_SAID = "none"
_SILENT = 1e-6  # [nat] of a reading, below which scans held out say nothing of what acts at edges, say, alone
_PLACES = {"hit x": "x of the walls", "hit y": "y of the walls", "v": "forward speed", "w": "yaw rate"}
_PLACES |= {"x": "x of the laser", "y": "y of the laser"}
_POSES = {  # each against where the reference puts it: it may be wrong itself
    "reference.x": "the laser's x, or of the reference's",
    "reference.y": "the laser's y, or of the reference's",
    "reference.heading": "the laser's heading, or of the reference's",
}


def with_scans(criticism: Criticism, finding: LaserFinding) -> Criticism:
    """Return a criticism of the base with what the scans say besides."""
    if finding.wrong is not None:
        verdict = Verdict("invalid_data", problems=(finding.wrong, *criticism.verdict.problems))
        told = replace(criticism.story, headline=wrong_data([finding.wrong]), details=(finding.wrong,))
        return replace(criticism, verdict=verdict, story=told, settings=())
    criticism = _with_drive(criticism, finding)
    verdict, story = criticism.verdict, criticism.story
    if finding.refused is not None:
        refusal = f"laser not criticised: {finding.refused}."
        told = replace(story, details=(*story.details, refusal, *finding.details))
        if not story.noise and verdict.verdict == _NOTHING_SAID:  # nothing was said of the base either
            told = replace(told, headline=f"No effect can be named: {finding.refused}.")
        return replace(criticism, story=told)
    kind: Kind = verdict.verdict
    if finding.unknown:
        kind = "unknown"
    elif finding.causes and kind != "unknown":
        kind = "named"
    elif finding.confounded and kind == _NOTHING_SAID:
        kind = "confounded"
    drawn = {(one.channel, one.covariate) for one in verdict.unknown}  # errors of the reference that drives tell, too
    joined = replace(
        verdict,
        verdict=kind,
        causes=(*verdict.causes, *finding.causes),
        confounded=(*verdict.confounded, *finding.confounded),
        unknown=(*verdict.unknown, *(one for one in finding.unknown if (one.channel, one.covariate) not in drawn)),
    )
    words = headline(finding)
    if words and verdict.verdict in ("named", "confounded", "unknown"):
        words = f"{story.headline} {words}"
    if finding.small and not words and kind == _NOTHING_SAID:
        slight = f"{', '.join(finding.small)} is detectable in the scans, but too small to matter."
        words = f"{story.headline} {slight}" if story.noise else f"No effect matters: {slight}"
    shown = finding.pictures
    told = replace(
        story,
        headline=words or story.headline,
        details=(*story.details, *finding.details),
        # The base's nearest suspect is of no interest where the scans have found something.
        misfits=(*(() if verdict.verdict == _NOTHING_SAID and words else story.misfits), *shown.misfits),
        comparisons=(*story.comparisons, *shown.comparisons),
        rivals=(*story.rivals, *shown.rivals),
        noise=(*story.noise, *shown.noise),
    )
    return replace(criticism, verdict=joined, story=told, settings=(*criticism.settings, *finding.settings))


def confirmed_scans(
    finding: LaserFinding, measure: Callable[[Settings], ChannelGain | None]
) -> tuple[LaserFinding, ChannelGain | None]:
    """Return a finding without what scans held out refuse, or do not confirm, and what the rest is worth.

    measure: returns what settings are worth. Where one of them loses it all, the others stay, or another curve takes
    its place. Where nothing is left of what is beyond doubt, something else is wrong: that is unresolved.
    """
    worth = measure(finding.settings)
    if worth is None or not finding.settings:
        return finding, worth
    finding, worth = _without_faint(finding, worth, measure)
    if worth is None or worth.log_density_per_sample.hi90 >= 0:
        return finding, worth
    ids = {setting.id for setting in finding.settings}
    kept: list[tuple[float, LaserFinding, ChannelGain]] = []
    for name in sorted(ids) if len(ids) > 1 else ():
        rest = refuted(finding, worth, {name})
        gained = measure(rest.settings)
        if gained is not None and gained.log_density_per_sample.hi90 >= 0:
            kept.append((gained.log_density_per_sample.gain, rest, gained))
    for one in finding.stand_ins:
        rest = _with_stand_in(refuted(finding, worth, {one.of}), finding, one)
        gained = measure(rest.settings)
        if gained is not None and confirmed(gained, finding.nats, free=True):
            kept.append((gained.log_density_per_sample.gain, rest, gained))
    if not kept:
        return _unresolved(finding, refuted(finding, worth, ids)), None
    _, rest, gained = max(kept, key=itemgetter(0))
    return rest, gained


def _with_stand_in(rest: LaserFinding, before: LaserFinding, one: StandIn) -> LaserFinding:
    """Return a finding without a curve, told with another in its place."""
    others = (each for each in before.unknown if each.channel != one.unknown.channel)
    return replace(rest, unknown=(one.unknown, *others), settings=(*rest.settings, one.setting))


def _unresolved(before: LaserFinding, left: LaserFinding) -> LaserFinding:
    """Return what is left of a finding, amber where neither chance nor the map can have made what was refused."""
    if max([before.nats, *(cause.gain_nats for cause in before.causes)]) < NO_NOISE:
        return left
    gone = ", ".join(setting.id for setting in before.settings)
    shape = f"nearest is {gone}, which held-out scans refuse"
    return replace(left, unknown=(*left.unknown, Unknown(UNKNOWN_SCATTER, UNRESOLVED, shape, UNRESOLVED_P)))


def _without_faint(
    finding: LaserFinding, worth: ChannelGain, measure: Callable[[Settings], ChannelGain | None]
) -> tuple[LaserFinding, ChannelGain | None]:
    """Return a finding without causes of little evidence by which scans held out gain nothing, and what it is worth.

    All together first: of two that undo each other, each gains beside the other.
    """
    gained: ChannelGain | None = worth
    faint = {cause.id: cause.gain_nats for cause in finding.causes if cause.gain_nats < CERTAIN}
    each = [{name: nats} for name, nats in faint.items()]
    for some in [faint, *each] if len(each) > 1 else each:
        if gained is None or not some.keys() <= {cause.id for cause in finding.causes}:
            continue
        words = (
            f"laser: {', '.join(sorted(some))} may act by the scans that this was found in ({max(some.values()):.1f} "
            "nats), but scans held out do not confirm it, so it is not told."
        )
        rest = _without(finding, some.keys(), words)
        left = measure(rest.settings) if rest.settings else None
        before, after = (0.0 if one is None else one.log_density_per_sample.gain for one in (left, gained))
        silent = abs(after - before) < _SILENT
        alone = left is None and confirmed(gained, max(some.values()))
        if not silent and not alone and (left is None or before >= after):
            finding, gained = rest, left
    return finding, gained


def refuted(finding: LaserFinding, worth: ChannelGain, gone: Set[str]) -> LaserFinding:
    """Return a finding without what predicts scans held out worse than the model does, which is chance's."""
    density = worth.log_density_per_sample
    words = (
        f"laser: {', '.join(sorted(gone))} explain the scans that they were found in, but with all that was found "
        f"scans held out lose {-density.gain:.3g} nats per reading (90 % {-density.hi90:.3g} to {-density.lo90:.3g}), "
        "so they are not told."
    )
    return _without(finding, gone, words)


def _without(finding: LaserFinding, gone: Set[str], words: str) -> LaserFinding:
    """Return a finding without some effects, and why.

    What extends no model, an error of the reference's poses, was not asked of scans held out, and stays.
    """
    strange, shown = any(name.startswith(effects.SMOOTH) for name in gone), finding.pictures
    left = Pictures(
        misfits=tuple(one for one in shown.misfits if one.explained_by not in gone),
        noise=shown.noise,
        comparisons=tuple(one for one in shown.comparisons if not gone & set(one.explained_by.split(" + "))),
    )
    return replace(
        finding,
        causes=tuple(cause for cause in finding.causes if cause.id not in gone),
        confounded=tuple(group for group in finding.confounded if not gone & set(group)),
        unknown=tuple(one for one in finding.unknown if one.channel in _POSES or not strange),
        settings=tuple(setting for setting in finding.settings if setting.id not in gone),
        details=(*finding.details, words),
        pictures=left,
    )


def _with_drive(criticism: Criticism, finding: LaserFinding) -> Criticism:
    """Return a criticism that proposes what the scans need, where the drives need nothing."""
    drive = finding.next_experiment
    if drive is None and finding.confounded and not criticism.story.next_drive:
        return replace(criticism, story=replace(criticism.story, next_drive=_undecided(finding.confounded[0])))
    if drive is None or criticism.verdict.next_experiment is not None:
        return criticism
    first, more = ", ".join(drive.separates[:LISTED_IDS]), len(drive.separates) - LISTED_IDS
    listed = f"{first} and {more} more" if more > 0 else first
    sentence = f"critic experiment {drive.id} ({drive.seconds:.0f} s). Its scans tell {listed} from similar effects."
    return replace(
        criticism,
        verdict=replace(criticism.verdict, next_experiment=drive),
        story=replace(criticism.story, next_drive=criticism.story.next_drive or sentence),
    )


def _undecided(names: Sequence[str]) -> str:
    """Return in a sentence what would tell effects from each other that no scripted experiment for the laser does."""
    moving = all(getattr(effects.by_id(name), "stage", None) is effects.LaserStage.GEOMETRY for name in names)
    other = "record a longer drive with more turns" if moving else "measure it in another way"
    return f"No scripted experiment can decide whether {' or '.join(names)} acts: {other}."


def headline(finding: LaserFinding) -> str:
    """Return what the scans say in a sentence; empty when they say nothing."""
    if finding.unknown:
        first = finding.unknown[0]
        if first.covariate == UNRESOLVED:
            return f"Readings scatter otherwise than in the model, and these scans do not say by what: {first.shape}."
        over = _PLACES.get(first.covariate, first.covariate)
        of = _POSES.get(first.channel, "the ranges")
        return f"No effect in the catalogue explains the error of {of}. It follows the {over}: {first.shape}."
    if finding.causes:
        return named_causes(finding.causes)
    if finding.confounded:
        return f"The model lacks an effect, but these scans cannot tell which: {' or '.join(finding.confounded[0])}."
    return ""
