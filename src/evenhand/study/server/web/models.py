"""What requests and answers look like."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, StringConstraints

_Id = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.:-]{0,99}$")]
_Text = Annotated[str, StringConstraints(max_length=4000)]
_Name = Annotated[str, StringConstraints(max_length=110)]


def _whole(value: Any) -> Any:
    # JSON knows one kind of number: 3.0 is a whole one
    return int(value) if isinstance(value, float) and value.is_integer() else value


# bounds stand before the validator, or the schema does not tell them
_Whole = Annotated[int, BeforeValidator(_whole)]
_Count = Annotated[int, Field(ge=0, le=10_000), BeforeValidator(_whole)]
_Sequence = Annotated[int, Field(ge=0, le=1_000_000), BeforeValidator(_whole)]
_Milliseconds = Annotated[int, Field(ge=-(2**53), le=2**53), BeforeValidator(_whole)]


class Strict(BaseModel):
    """Nothing is converted, nothing unknown is taken."""

    model_config = ConfigDict(strict=True, extra="forbid")


class Platform(Strict):
    """Ids of a recruiting platform."""

    PROLIFIC_PID: _Id | None = None
    STUDY_ID: _Id | None = None
    SESSION_ID: _Id | None = None


class Begin(Strict):
    """Somebody agrees to the consent text."""

    consent_version: Annotated[str, StringConstraints(min_length=1, max_length=40)]
    external: Platform | None = None
    token: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{43}$")] | None = None
    simulated: bool = False
    preview: bool = False


class Page(Strict):
    """The answers of one page."""

    key: Annotated[
        str,
        StringConstraints(
            pattern=r"^[0-9a-fA-F]{8}-[0-9a-fA-F]{4}-[0-9a-fA-F]{4}-[0-9a-fA-F]{4}-[0-9a-fA-F]{12}$"
        ),
    ]
    sequence: _Sequence
    values: Annotated[
        dict[_Name, _Text | _Whole | Annotated[list[_Name], Field(max_length=100)] | None],
        Field(max_length=200),
    ]
    shown_ms: _Milliseconds
    clip_views: Annotated[dict[_Name, _Count], Field(max_length=100)] = {}
    at: Annotated[str, StringConstraints(pattern=r"^[ -~]{0,40}$")] = ""


class Nothing(Strict):
    """An empty object."""


class Consent(BaseModel):
    """Of the study."""

    version: str
    text: str


class Study(BaseModel):
    """What everybody may know."""

    name: str
    title: str
    language: str
    minutes: int
    contact: str
    consent: Consent
    pages_total: int
    preview: bool
    shared_computer: bool


class StateTold(BaseModel):
    """How far a participant is."""

    pages: list[dict[str, Any]]
    answered: dict[str, int]
    next: str
    finished: bool


class Begun(BaseModel):
    """The token, told this once."""

    token: str
    state: StateTold


class Saved(BaseModel):
    """A page is stored."""

    saved: Literal[True]
    next: str
    repeated: bool


class Finished(BaseModel):
    """Everything is stored."""

    code: str
    redirect: str


class Deleted(BaseModel):
    """Nothing is stored any more."""

    deleted: Literal[True]


class Wrong(BaseModel):
    """Every error: a plain sentence, and a word for programs."""

    error: str
    code: str
    next: str | None = None


class Closed(Strict):
    """Whether the study takes no more answers."""

    closed: bool
