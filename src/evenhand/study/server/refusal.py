"""Why a request of a participant is refused: a word for programs and a sentence for people."""

STATUS = {
    "already-answered": 409,
    "already-begun": 409,
    "closed": 409,
    "invalid": 422,
    "key-reused": 409,
    "not-finished": 409,
    "not-simulated": 403,
    "other-consent": 409,
    "out-of-order": 409,
    "unknown-page": 404,
    "unknown-token": 401,
    "withdrawn": 410,
}
"""HTTP status of every code."""


class RefusalError(Exception):
    """A request that cannot be granted; nothing was changed.

    Attributes:
        code: one of ``STATUS``.
        sentence: what is wrong and what to do, in plain words.
        next: id of the page that is to be answered next, where that helps.
    """

    def __init__(self, code: str, sentence: str, next: str | None = None) -> None:
        super().__init__(sentence)
        self.code, self.sentence, self.next = code, sentence, next

    @property
    def status(self) -> int:
        """The HTTP status."""
        return STATUS[self.code]


class StorageError(RuntimeError):
    """The database cannot store or read just now; what was acknowledged before is safe."""
