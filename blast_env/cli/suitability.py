"""The uses of a scenario in the commands, engine by engine, and its limits with their remedies."""

from collections.abc import Iterator
from typing import Final

from blast_env.errors import BlastEnvError
from blast_env.evaluation.engines import CALIBRATED_ENGINES, JUDGE
from blast_env.particles.calibration.model import scenario_calibration
from blast_env.site import AnyScenario, PointSource, Scenario, find_scenario

_PLACING: Final = "search, train, evaluate, judge and BlastBarrier-v0"
_PRESETS_NOT_FOR_DESIGN: Final = {
    "ballistic": "its air is so thin that next to nothing gets round a wall "
    "(docs/engineers/validity.md)"
}


def suitability(scenario: AnyScenario) -> tuple[list[str], list[str]]:
    """Return the possible uses of a scenario, and its limits with their remedies."""
    found = find_scenario(scenario)
    refusals = {engine: _refusal(found, engine) for engine in CALIBRATED_ENGINES}
    able = [JUDGE, *(engine for engine, refusal in refusals.items() if not refusal)]
    uses = ["simulate with every engine"]
    if found.particle_problems:
        uses = [f"simulate with {JUDGE}"]
    if found.build_zone is not None:
        uses.append(f"placing barriers ({_PLACING}) with {', '.join(able)}")
        uses.append(f"report ({JUDGE})")
    return uses, [*_limits(found, refusals)]


def _refusal(scenario: Scenario, engine: str) -> str:
    """Return why a particle engine cannot give loads in Pa s; empty if it can."""
    try:
        scenario_calibration(scenario, engine)
    except BlastEnvError as error:
        return str(error)
    return ""


def _limits(scenario: Scenario, refusals: dict[str, str]) -> Iterator[str]:
    if scenario.build_zone is None:
        yield f"no build zone: nothing can be placed, report, {_PLACING} refuse it ([build_zone])"
    yield from _particle_limits(scenario, refusals)
    yield from _height_limits(scenario)
    yield from _charge_limits(scenario)
    if not scenario.gauges:
        yield f"no gauges: simulate --engine {JUDGE} has no --history to draw ([[gauges]])"


def _particle_limits(scenario: Scenario, refusals: dict[str, str]) -> Iterator[str]:
    problems = [str(problem) for problem in scenario.particle_problems]
    if problems:
        yield f"particles cannot run it, gas can: {'; '.join(problems)}"
    if scenario.calibration is None:
        yield (
            "no calibration: particles give simulation units alone, and where Pa s are needed "
            f"({_PLACING}) {' and '.join(CALIBRATED_ENGINES)} refuse it; gas needs none"
        )
    else:
        for reason in dict.fromkeys(refusals.values()):
            engines = [
                engine for engine, refusal in refusals.items() if refusal == reason and refusal
            ]
            if engines:
                yield f"no loads in Pa s with {' and '.join(engines)}: {reason}"
    name = scenario.simulation.preset
    if name in _PRESETS_NOT_FOR_DESIGN:
        yield (
            f"preset {name!r} is not meant for design: {_PRESETS_NOT_FOR_DESIGN[name]}; judge "
            f"layouts with --engine {JUDGE}"
        )


def _height_limits(scenario: Scenario) -> Iterator[str]:
    zone = scenario.build_zone
    endless = [structure.name for structure in scenario.structures if structure.height_m is None]
    if zone is not None and not zone.items and zone.height_m is None:
        endless.append("the modules of the build zone")
    if endless:
        yield (
            f"no height ({', '.join(endless)}): as high as the air, {scenario.air_height_m:g} m, "
            f"so {JUDGE} overrates walls (height_m)"
        )
    for note in scenario.height_notes:
        yield f"particles: {note[0].lower()}{note[1:]}"


def _charge_limits(scenario: Scenario) -> Iterator[str]:
    if scenario.vehicles:
        yield (
            "a vehicle brings a charge, to where the layout lets it come: calibrate and simulate "
            "--stand-off refuse it, and --charge puts the charge where no vehicle is"
        )
    yield from _speed_limits(scenario)
    if len(scenario.charge) == 1 and isinstance(scenario.charge[0], PointSource):
        yield (
            "the charge is always at one place: a hidden threat adds nothing, and an agent trained "
            "on it learns no other place"
        )


def _speed_limits(scenario: Scenario) -> Iterator[str]:
    """Yield limits due to missing speeds of vehicles and missing crash ratings."""
    if any(source.motion is None for source in scenario.vehicles):
        yield (
            "a vehicle without a speed: whatever stops vehicles stops it, however heavy and fast "
            "it may be ([charge.motion])"
        )
    zone = scenario.build_zone
    if zone is None or all(source.motion is None for source in scenario.vehicles):
        return
    unrated = [item.name for item in zone.items if item.stops_vehicles and not item.crash_rating]
    if not zone.items:
        unrated.append("the modules")
    if zone.access_way and zone.access_way.gate and not zone.access_way.gate.crash_rating:
        unrated.append("the gate")
    if unrated:
        yield (
            f"no crash rating ({', '.join(unrated)}): stops a vehicle of any mass at any speed "
            "(crash_rating)"
        )
