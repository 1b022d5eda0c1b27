"""Scenes in glTF 2.0, as binary files (.glb), for viewers and Blender.

Source: registry.khronos.org/glTF/specs/2.0. Its axes are x to the right, y upwards and z towards
the viewer, in metres: a site's (x, y, z) becomes (x, z, -y).
"""

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from blast_env.arrays import FloatArray
from blast_env.files import write_atomically

UNLIT: Final = "KHR_materials_unlit"
"""The extension that keeps colours as they are in the legend, without light and shade."""

_MAGIC: Final = b"glTF"
_VERSION: Final = 2
_JSON, _BINARY = 0x4E4F534A, 0x004E4942  # types of chunks
_FLOAT, _BYTE = 5126, 5121  # types of components
_ARRAY_BUFFER: Final = 34962
_ALIGNMENT: Final = 4
_BLACK_END: Final = 0.04045


@dataclass(frozen=True, eq=False)
class Mesh:
    """A body or surface.

    Attributes:
        triangles_m: Corners of its triangles on the site, m (n, 3, 3), counterclockwise as they are
            seen from outside.
        colours: Colour of each triangle as on a screen, 0 to 1 (n, 3).
        is_lit: Whether it has light and shade, rather than the colours of a legend.
        extras: What programs may read of it: numbers with units in their names.
    """

    name: str
    triangles_m: FloatArray
    colours: FloatArray
    is_lit: bool = True
    extras: Mapping[str, Any] = field(default_factory=dict)


def write_glb(meshes: Sequence[Mesh], path: Path, name: str, extras: Mapping[str, Any]) -> None:
    """Write a scene with a node for each mesh.

    Args:
        meshes: The meshes; those without a triangle are left out.
        extras: What programs may read of the scene.
    """
    # glTF 2.0: a header, a chunk of JSON and a chunk of numbers (Khronos, section 4, GLB).
    shown = [mesh for mesh in meshes if len(mesh.triangles_m)]
    buffer = _Buffer()
    document = {
        "asset": {"version": "2.0", "generator": "blast-env"},
        "extensionsUsed": [UNLIT],
        "scene": 0,
        "scenes": [{"name": name, "nodes": [*range(len(shown))], "extras": dict(extras)}],
        "nodes": [
            {
                "name": mesh.name,
                "mesh": number,
                **({"extras": dict(mesh.extras)} if mesh.extras else {}),
            }
            for number, mesh in enumerate(shown)
        ],
        "meshes": [{"name": mesh.name, "primitives": [_primitive(mesh, buffer)]} for mesh in shown],
        "materials": [
            {
                "name": "lit",
                "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0},
            },
            {"name": "legend", "extensions": {UNLIT: {}}},
        ],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.content)}],
    }
    text = json.dumps(document, allow_nan=False).encode()
    # Chunks begin at multiples of four bytes: the JSON is filled up with spaces.
    text += b" " * (-len(text) % _ALIGNMENT)
    chunks = b"".join(
        struct.pack("<II", len(chunk), kind) + chunk
        for kind, chunk in ((_JSON, text), (_BINARY, bytes(buffer.content)))
    )
    with write_atomically(path) as temporary:
        temporary.write_bytes(_MAGIC + struct.pack("<II", _VERSION, 12 + len(chunks)) + chunks)


def _primitive(mesh: Mesh, buffer: "_Buffer") -> dict[str, Any]:
    corners = mesh.triangles_m[..., [0, 2, 1]] * (1.0, 1.0, -1.0)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    colours = np.column_stack((linear(mesh.colours), np.ones(len(mesh.colours))))
    attributes = {
        "POSITION": buffer.add(corners.reshape(-1, 3).astype("<f4"), has_bounds=True),
        "NORMAL": buffer.add(np.repeat(normals, 3, axis=0).astype("<f4")),
        "COLOR_0": buffer.add(np.repeat(np.rint(255.0 * colours), 3, axis=0).astype("u1")),
    }
    return {"attributes": attributes, "material": 0 if mesh.is_lit else 1}


def linear(colours: FloatArray) -> FloatArray:
    """Return colours as on a screen (sRGB) in proportion to light, as glTF has those of corners.

    Source: IEC 61966-2-1, in section 3.9.2 of the specification for textures.
    """
    curved = ((colours + 0.055) / 1.055) ** 2.4
    return np.where(colours <= _BLACK_END, colours / 12.92, curved)


class _Buffer:
    """The binary part of a file, with the tables that say what is where."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: Any, has_bounds: bool = False) -> int:
        """Add an array, (n, 3) or (n, 4); return the number of its accessor."""
        view = {
            "buffer": 0,
            "byteOffset": len(self.content),
            "byteLength": values.nbytes,
            "target": _ARRAY_BUFFER,
        }
        accessor = {
            "bufferView": len(self.views),
            "componentType": _FLOAT if values.dtype.kind == "f" else _BYTE,
            "count": len(values),
            "type": f"VEC{values.shape[1]}",
        }
        if values.dtype.kind != "f":
            accessor["normalized"] = True
        if has_bounds:
            accessor["min"] = values.min(axis=0).tolist()
            accessor["max"] = values.max(axis=0).tolist()
        self.content += values.tobytes()
        self.views.append(view)
        self.accessors.append(accessor)
        return len(self.accessors) - 1
