"""The records of the tools: what a call is given, and what it returns."""

from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from blast_env.geometry import Element, Layout, Piece

SPLITS: Final = ("train", "test", "benchmark")
"""The names of the splits of tasks."""

BUDGET: Final = 10
"""Default budget of a session, in blasts."""

MOST_PIECES: Final = 1000
"""Most pieces of a layout in a call."""


class Record(BaseModel):
    """Base of the records: unknown keys are errors, and nothing changes afterwards."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class PlacedPiece(Record):
    """A piece of a layout."""

    row: Annotated[int, Field(ge=0, description="Row of its lower left cell, from 0 upwards.")]
    column: Annotated[int, Field(ge=0, description="Column of that cell, from 0 to the right.")]
    item: Annotated[
        str,
        Field(max_length=80, description="Name of the item; empty where `look` lists no items."),
    ] = ""
    turned: Annotated[
        bool, Field(description="Whether its length runs upwards instead of to the right.")
    ] = False

    @classmethod
    def of(cls, element: Element) -> "PlacedPiece":
        """Return the record of an element."""
        if isinstance(element, Piece):
            return cls(**Piece._asdict(element))
        return cls(row=element[0], column=element[1])

    @property
    def element(self) -> Element:
        """The element, which need not exist."""
        if not self.item and not self.turned:
            return self.row, self.column
        return Piece(self.row, self.column, self.item, self.turned)


Pieces = Annotated[tuple[PlacedPiece, ...], Field(max_length=MOST_PIECES)]


def pieces_of(layout: Layout) -> tuple[PlacedPiece, ...]:
    """Return the records of a layout."""
    return tuple(PlacedPiece.of(element) for element in layout)


class NoArguments(Record):
    """No argument."""


class LookArguments(Record):
    """What `look` is asked for."""

    picture: Annotated[bool, Field(description="Whether to add a picture of the plan.")] = False


class LayoutArguments(Record):
    """A layout."""

    layout: Annotated[Pieces, Field(description="All pieces of the layout; none for no barrier.")]


class TicketArguments(Record):
    """A ticket."""

    ticket: Annotated[str, Field(max_length=80, description="As `blast` or `submit` gave it.")]


class Answer(Record):
    """What every tool returns beside its own results."""

    blasts_left: Annotated[int, Field(description="Blasts that remain in the budget.")]
    seconds: Annotated[float, Field(description="Seconds since the session began.")]
    validity: Annotated[str, Field(description="What the numbers are good for.")]


class Building(Record):
    """A structure of the site, by the rectangle around it."""

    name: str
    protected: Annotated[bool, Field(description="Whether its load counts.")]
    west_m: float
    south_m: float
    east_m: float
    north_m: float
    height_m: float | None


class Threat(Record):
    """A charge that goes off."""

    tnt_kg: float
    height_m: float
    x_m: Annotated[float, Field(description="Its place; of a vehicle, without barriers.")]
    y_m: float
    vehicle: Annotated[bool, Field(description="Whether it drives to the worst place in reach.")]


class ItemOnOffer(Record):
    """An item of the catalogue, or a measure, which stands at row 0, column 0."""

    item: str
    description: str
    length_cells: int
    thickness_cells: int
    height_m: float
    cost: float
    pieces: Annotated[int, Field(description="Pieces in stock.")]
    rotatable: bool
    stops_vehicles: bool


class Picture(Record):
    """A picture."""

    media_type: Literal["image/png"] = "image/png"
    base64: str


class Look(Answer):
    """The site, the task and its score."""

    problem: str
    task: str
    score_0: Annotated[str, Field(description="What scores 0.")]
    score_1: Annotated[str, Field(description="What scores 1.")]
    seed: int
    blasts_per_layout: Annotated[int, Field(description="Blasts that one call of `blast` costs.")]
    width_m: Annotated[float, Field(description="Extent of the site in x, from west to east.")]
    height_m: Annotated[float, Field(description="Extent in y, from south to north.")]
    threats: tuple[Threat, ...]
    buildings: tuple[Building, ...]
    zone_west_m: Annotated[float, Field(description="x of the lower left corner of cell (0, 0).")]
    zone_south_m: Annotated[float, Field(description="y of the same corner.")]
    cell_m: float
    rows: int
    columns: int
    items: tuple[ItemOnOffer, ...]
    most_pieces: int
    cost_limit: float | None
    cost_unit: str
    plan: Annotated[
        tuple[str, ...],
        Field(
            description="The zone, a text per row, the uppermost first: `.` may take a piece, `x` "
            "may not."
        ),
    ]
    picture: Picture | None


class Proposal(Record):
    """The layout of a rule of thumb, or why it has none."""

    rule: str
    layout: tuple[PlacedPiece, ...]
    cost: float
    note: str


class Proposals(Answer):
    """What each rule of thumb proposes, and a random layout of the session's seed."""

    proposals: tuple[Proposal, ...]


class Legality(Answer):
    """Whether a layout is legal."""

    legal: bool
    reasons: Annotated[tuple[str, ...], Field(description="A sentence per illegal piece.")]
    cost: Annotated[float, Field(description="Cost of its legal pieces.")]


class ShareByGuess(Answer):
    """A prediction of the share of the load that a layout leaves."""

    share: Annotated[float, Field(description="Share of the load without a barrier that remains.")]
    low: Annotated[float, Field(description="Lower end of its 95 % interval.")]
    high: Annotated[float, Field(description="Upper end of its 95 % interval.")]


class BuildingLoad(Record):
    """The load on a protected structure under one threat."""

    threat: Annotated[int, Field(description="Number of the threat in `look`, from 0.")]
    building: str
    impulse_pa_s: Annotated[
        float | None, Field(description="None where pieces hide its walls: no load is known.")
    ]
    peak_pa: float | None
    validity: str


class ShareByBlast(Record):
    """The result of a blast."""

    share: Annotated[float, Field(description="Share of the load without a barrier that remains.")]
    charged: Annotated[int, Field(description="Blasts that it cost, once for each layout.")]
    loads: tuple[BuildingLoad, ...]


class Score(Record):
    """The result of the judge, which ends the session."""

    score: Annotated[float, Field(ge=0.0, le=1.0)]
    share: Annotated[float, Field(description="Share of the load that the layout leaves.")]
    best_share: Annotated[float, Field(description="The same for the best known layout.")]


class Outcome(Answer):
    """A blast or a score; or, while it takes long, only the ticket to poll."""

    ticket: str
    running: Annotated[bool, Field(description="Whether to call `poll` with the ticket.")]
    blast: ShareByBlast | None = None
    score: Score | None = None
