"""Compile what Numba keeps on disk for the tests, once: `python -m tests.compile_engines`.

Tests in several processes that all find nothing on disk would each compile the same. They still
may: nothing depends on this but the time.
"""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from blast_agents import packaged_agent

from blast_env import load_scenario, simulate
from blast_env.envs.vector_env import BlastBarrierVectorEnv
from blast_env.evaluation import BlastEvaluator
from blast_env.evaluation.engines.gas import GasEngine
from blast_env.gas import (
    FaceLoads,
    GasCharge,
    GasGrid,
    GasSolver,
    Gauges,
    GroundMap,
    Settling,
    ground_faces,
    set_charge,
)
from blast_env.layout import LayoutState, draw_charge
from blast_env.site import Scenario
from blast_env.sites import SiteMeasures
from blast_env.surrogate import SurrogateEngine, Ways, piece_traits, site_of, solid_relations
from tests.blasts import consequences
from tests.catalogue_sites import yard
from tests.gas_sites import WALL, glazed_hut
from tests.site.documents import driven_document
from tests.vehicle_sites import gate_site


def event_engine() -> None:
    simulate(load_scenario("courtyard"), engine="event")


def gas_in_single_precision() -> None:
    """Every kernel: a charge on the ground burns, seen by every recorder that is compiled."""
    grid = GasGrid(0.5, np.zeros((24, 24, 12), dtype=bool))
    faces = ground_faces(grid)
    charge = GasCharge(1.0, (6.0, 6.0, 0.0))
    solver = GasSolver(
        grid,
        faces=faces,
        recorders=(FaceLoads(len(faces)), Gauges(grid, [(3, 3, 3)]), GroundMap(grid)),
        with_fuel=True,
        burning=charge.burning,
        settling=Settling(0.0, 2.0),
    )
    set_charge(solver, charge)
    for _ in range(4):  # hot gas is cooled at every fourth
        solver.step()


def gas_in_double_precision() -> None:
    """The kernels of exact flows, with and without fuel."""
    GasSolver(GasGrid(0.5, np.zeros((8, 8, 8), dtype=bool)), precision="double").step()


def surrogate() -> None:
    """Also of one charge and layout, and what other kernels have in themselves."""
    piece = np.array([[4.0, -1.0, 5.0, 1.0, 2.0]])
    points = np.array([[9.0, 0.0, 1.0]])
    Ways.between(np.zeros(3), points, 100.0, piece).shares(piece)
    solid_relations(np.zeros(3), points, np.array([[-1.0, 0.0]]), 1.0, piece)
    piece_traits(np.zeros(3), 1.0, piece, piece)
    site = load_scenario("control_room")
    layout = LayoutState(site, ())
    (first, *_) = layout.legal.ravel().nonzero()[0]
    layout = layout.place(layout.catalogue.element(int(first)))
    charge, engine = draw_charge(site, 0), SurrogateEngine()
    for elements in ((), layout.layout):  # what is kept of a charge comes with the second
        engine.loads(site, elements, charge)
    site_of(site).approach(charge)
    packaged_agent().propose(site, charge)


def batches() -> None:
    """Of environments: without a gate, with a way to keep open, and with a vehicle."""
    for site in (load_scenario("control_room"), load_scenario("perimeter_gate"), gate_site()):
        envs = BlastBarrierVectorEnv(
            2, scenario=site, engine=SurrogateEngine(), observation="features", action="place"
        )
        _, info = envs.reset(seed=0)
        for _ in range(6):
            *_, info = envs.step(info["action_mask"].argmax(axis=1))


def sights() -> None:
    """As bits, which are those of a catalogue."""
    SiteMeasures.of(yard())


def driving() -> None:
    vehicle = Scenario.from_document(driven_document(), "driven")
    for source in vehicle.vehicles:
        ground = vehicle.vehicle_ground(source)
        assert ground.drive().speeds is not None
        assert ground.worst_places().places_m


def response() -> None:
    """Of facades and pieces, after a blast on cells that are merged."""
    site = glazed_hut()
    consequences(BlastEvaluator(site, GasEngine(cells="coarse")), WALL, [draw_charge(site, 0)])


def gas() -> None:
    gas_in_single_precision()
    gas_in_double_precision()
    response()


def gas_and_driving() -> None:
    gas()
    driving()


def everything_else() -> None:
    surrogate()
    batches()
    event_engine()
    sights()


def main() -> None:
    """Compile on two cores, in parts that share little and take about as long."""
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        for part in [pool.submit(gas_and_driving), pool.submit(everything_else)]:
            part.result()


if __name__ == "__main__":
    main()
