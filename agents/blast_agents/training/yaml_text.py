"""Reading YAML that people write or edit: plain data, small, not deep, and nothing twice."""

from collections.abc import Hashable
from typing import Any, Final

import yaml

from blast_env.documents import MAX_DEPTH, MAX_DIGITS, DocumentError

MOST_CHARACTERS: Final = 100_000
"""PyYAML takes a second for so many."""


class _PlainLoader(yaml.SafeLoader):
    """Reads numbers, texts, lists and tables.

    No aliases, with which a kilobyte becomes gigabytes; no keys twice; no dates, which are texts.
    """

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        if self.check_event(yaml.AliasEvent):
            raise self._refused("has an alias, must have none", mark)
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise self._refused(f"is nested too deeply: more than {MAX_DEPTH} levels", mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        mapping = super().construct_mapping(node, deep)
        if len(mapping) < len(node.value):
            raise self._refused("has a key twice", node.start_mark)
        return mapping

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        if len(node.value) > MAX_DIGITS:
            digits = len(node.value)
            raise self._refused(f"has a number of {digits} digits, too large", node.start_mark)
        return super().construct_yaml_int(node)

    @staticmethod
    def _refused(message: str, mark: yaml.Mark) -> DocumentError:
        return DocumentError(f"line {mark.line + 1}, column {mark.column + 1}", message)


_PLAIN_TAGS: Final = tuple(
    f"tag:yaml.org,2002:{name}" for name in ("null", "bool", "int", "float", "str", "seq", "map")
)
_PlainLoader.yaml_constructors = {
    **{tag: yaml.SafeLoader.yaml_constructors[tag] for tag in (*_PLAIN_TAGS, None)},
    "tag:yaml.org,2002:int": _PlainLoader.construct_yaml_int,
}
_PlainLoader.yaml_implicit_resolvers = {
    first: [(tag, expression) for tag, expression in resolvers if tag in _PLAIN_TAGS]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def parse_yaml(text: str) -> Any:
    """Return what the text of a YAML file holds.

    Raises:
        DocumentError: If it is not YAML, or has anything of what the loader above refuses.
    """
    if len(text) > MOST_CHARACTERS:
        raise DocumentError("", f"has {len(text)} characters, must have at most {MOST_CHARACTERS}")
    try:
        return yaml.load(text, _PlainLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = "" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}"
        raise DocumentError(place, f"is not YAML: {error.problem or error.context}") from error
    except DocumentError:
        raise
    # Of a character that is none, or of values such as `0b_` or `!!bool x`.
    except (yaml.YAMLError, ValueError, KeyError) as error:
        raise DocumentError("", f"is not YAML: {' '.join(str(error).split())[:200]}") from error
