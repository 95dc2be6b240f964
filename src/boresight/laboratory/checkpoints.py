"""Checkpoints: a folder that keeps what is done of a study, so that it can go on later.

Every second or so (the longer a study runs, the less often, up to a minute) what was done since is
written as one file: the sums as nodes of the tree over runs, and the numbers of each run that they
cover. A file is written beside and moved into place and ends with its own checksum, so it is whole
or it is ignored; and since a node says which runs it holds, files may be read in any order, twice,
or by a study with more runs. `study.json` says what decides the study's numbers, line by line.
"""

import hashlib
import io
import json
import os
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from boresight.errors import OutputError, UsageError
from boresight.laboratory.identity import differences
from boresight.laboratory.scores import Node, Scores
from boresight.laboratory.sums import Tree

Array = Any
Cell = tuple[int, int]
_LEAST_S, _MOST_S, _SHARE = 1.0, 60.0, 0.01
_MOST_BYTES = 1 << 26  # of sums that are remembered before neighbours are joined
_ABOUT, _PARTS = "study.json", "runs-*.npz"


class Checkpoints:
    """The checkpoints of one study in one folder."""

    def __init__(
        self,
        folder: Path,
        name: str,
        identity: Mapping[str, str],
        *,
        resume: bool,
        remark: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Open a folder for a study.

        Args:
            folder: made if it is not there.
            name: of the study, for messages.
            identity: what decides its numbers, as `identity.identity` gives it.
            resume: take what is there; otherwise there must be no unfinished study.
            remark: told of files that are ignored.

        Raises:
            UsageError: the folder holds an unfinished study, or to resume, another one.
            OutputError: the folder cannot be written to.
        """
        self._folder, self._name, self._identity, self._remark = folder, name, identity, remark
        self._mark = hashlib.sha256(json.dumps(dict(identity), sort_keys=True).encode()).hexdigest()
        self._pending: dict[Cell, list[Scores]] = {}
        self._size = 0
        self._began = self._written = time.monotonic()
        about = _read_json(folder / _ABOUT)
        if resume:
            self._check_same(about)
        else:
            self._clear(about)
        for path in self._folder.glob("*.partial"):
            path.unlink(missing_ok=True)
        self._describe(is_finished=False)

    def _check_same(self, about: Mapping[str, Any] | None) -> None:
        if about is None:
            if not any(self._folder.glob(_PARTS)):
                self._remark(f"{self._folder} holds nothing to resume: all runs are new")
            return
        if found := differences(self._identity, about["identity"]):
            more = f", and {len(found) - 3} more" if len(found) > 3 else ""
            raise UsageError(
                f"{self._folder} holds another study, {about['name']!r}",
                why="; ".join(found[:3]) + more,
                next_step="give the study as it was, or another folder",
            )

    def _clear(self, about: Mapping[str, Any] | None) -> None:
        parts = [*self._folder.glob(_PARTS)]
        if parts and not (about and about["is_finished"]):
            whose = f"the study {about['name']!r}" if about else "a study"
            raise UsageError(
                f"{self._folder} holds what was done of {whose}, which is not finished",
                next_step=f"add --resume to go on with it, or remove it: rm -r {self._folder}",
            )
        for path in parts:
            path.unlink(missing_ok=True)

    def _describe(self, *, is_finished: bool) -> None:
        content = {"name": self._name, "is_finished": is_finished, "identity": dict(self._identity)}
        text = json.dumps({"content": content, "sha256": _sha256(content)}, indent=1)
        self._write(self._folder / _ABOUT, text.encode())

    def read(self) -> Iterator[tuple[Cell, Scores]]:
        """What is there, a node at a time: the cell, and the scores of the node's runs."""
        ignored = 0
        for path in sorted(self._folder.glob(_PARTS)):
            found = _decode(_bytes(path), self._mark)
            ignored += found is None
            yield from found or ()
        if ignored:
            self._remark(
                f"{ignored} file{'s' * (ignored > 1)} of {self._folder} cut, corrupt or of another "
                "study: ignored, and their runs are done again"
            )

    def keep(self, cell: Cell, scores: Scores) -> None:
        """Remember a chunk, and write what is remembered if it is time to.

        Raises:
            OutputError: it cannot be written.
        """
        self._pending.setdefault(cell, []).append(scores)  # whole, or not at all, if interrupted
        self._size += sum(array.nbytes for node in scores.nodes for array in node.sums.values())
        now = time.monotonic()
        due = self._written + min(max(_LEAST_S, _SHARE * (now - self._began)), _MOST_S)
        if now >= due or self._size > _MOST_BYTES:
            self.flush()

    def flush(self) -> None:
        """Write what is remembered.

        Raises:
            OutputError: it cannot be written.
        """
        if self._pending:
            path = self._folder / _PARTS.replace("*", secrets.token_hex(8))
            self._write(path, _encode(self._pending, self._mark))
            self._pending.clear()  # after writing: twice there is better than never
        self._size, self._written = 0, time.monotonic()

    def finish(self) -> None:
        """Nothing is missing: the folder may be used again.

        Raises:
            OutputError: it cannot be written.
        """
        self.flush()
        self._describe(is_finished=True)

    def _write(self, path: Path, data: bytes) -> None:
        """Beside, down to the disk, then into place."""
        beside = path.with_suffix(".partial")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with beside.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            beside.replace(path)
        except OSError as error:
            raise OutputError(
                f"{path} cannot be written",
                why=str(error.strerror or error),
                next_step="make room, or give another folder; --resume keeps what was written",
            ) from None


def _sha256(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _read_json(path: Path) -> Mapping[str, Any] | None:
    """What a folder says of its study; None where it says nothing, or nothing whole."""
    try:
        told = json.loads(path.read_bytes())
        content: Mapping[str, Any] = told["content"]
        is_whole = told["sha256"] == _sha256(content)
    except (OSError, ValueError, TypeError, LookupError):
        return None
    return content if is_whole else None


def _bytes(path: Path) -> bytes:
    """What a file holds; nothing if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError:
        return b""


def _encode(pending: Mapping[Cell, list[Scores]], mark: str) -> bytes:
    """One file: the arrays of each cell under its number, and the checksum of all."""
    arrays: dict[str, Array] = {"mark": np.array(mark)}
    for (setting, contender), chunks in pending.items():
        in_order = sorted(chunks, key=attrgetter("first"))
        nodes = Tree(node for each in in_order for node in each.nodes).nodes
        key = f"{setting}/{contender}"
        arrays[f"{key}/nodes"] = np.array([(each.level, each.index) for each in nodes])
        arrays[f"{key}/seconds"] = np.array(sum(each.seconds for each in in_order))
        for name in nodes[0].sums:
            arrays[f"{key}/sums/{name}"] = np.stack([each.sums[name] for each in nodes])
        for name in in_order[0].runs:
            arrays[f"{key}/runs/{name}"] = np.concatenate([each.runs[name] for each in in_order])
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, **arrays)
    data = file.getvalue()
    return data + hashlib.sha256(data).digest()


def _decode(data: bytes, mark: str) -> list[tuple[Cell, Scores]] | None:
    """The inverse of `_encode`, a node at a time; None if cut, corrupt or another study's."""
    body, checksum = data[:-32], data[-32:]
    if hashlib.sha256(body).digest() != checksum:
        return None
    with np.load(io.BytesIO(body), allow_pickle=False) as file:
        arrays = dict(file)
    if arrays["mark"] != mark:
        return None
    keys = [each.removesuffix("/nodes") for each in arrays if each.endswith("/nodes")]
    cells = [(key, *map(int, key.split("/"))) for key in keys]
    return [((i, j), chunk) for key, i, j in cells for chunk in _chunks(arrays, key)]


def _chunks(arrays: Mapping[str, Array], key: str) -> Iterator[Scores]:
    """The scores of one cell, a node each; the time is counted with the first one."""
    sums, runs = (_below(arrays, f"{key}/{kind}/") for kind in ("sums", "runs"))
    done, seconds = 0, float(arrays[f"{key}/seconds"])
    for i, (level, index) in enumerate(arrays[f"{key}/nodes"].tolist()):
        count = 1 << level
        yield Scores(
            first=index << level,
            count=count,
            runs={name: values[done : done + count] for name, values in runs.items()},
            nodes=(Node(level, index, {name: values[i] for name, values in sums.items()}),),
            seconds=seconds,
        )
        done, seconds = done + count, 0.0


def _below(arrays: Mapping[str, Array], prefix: str) -> dict[str, Array]:
    return {n.removeprefix(prefix): a for n, a in arrays.items() if n.startswith(prefix)}
