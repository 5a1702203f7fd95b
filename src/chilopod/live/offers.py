"""What a browser may say: the messages of viser's own client, in types and ranges, and elements that the page has."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
import viser

LARGEST = 16_384
"""Bytes of a message; those of viser's client have a few hundred."""

_Number = Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)]
_Pixels = Annotated[int, msgspec.Meta(ge=0, le=65_536)]
_Name = Annotated[str, msgspec.Meta(max_length=200)]
_Place = tuple[_Number, _Number, _Number]
_Modifier = Annotated[str, msgspec.Meta(pattern=r"^(cmd/ctrl|alt|shift)(\+(cmd/ctrl|alt|shift))*$")] | None


class _Message(msgspec.Struct, tag_field="type", forbid_unknown_fields=True):
    """A message; names and fields are viser's."""


class _Camera(_Message, tag="ViewerCameraMessage"):
    wxyz: tuple[_Number, _Number, _Number, _Number]
    position: _Place
    fov: _Number
    near: _Number
    far: _Number
    image_height: _Pixels
    image_width: _Pixels
    look_at: _Place
    up_direction: _Place


class _Click(_Message, tag="ScenePointerMessage"):
    event_type: Literal["click"]
    ray_origin: _Place
    ray_direction: _Place
    screen_pos: tuple[tuple[_Number, _Number]]
    modifier: _Modifier


class _Drag(_Message, tag="SceneNodeDragMessage"):
    phase: Literal["start", "update", "end"]
    name: _Name
    instance_index: int
    start_position: _Place
    start_screen_pos: tuple[_Number, _Number]
    end_position: _Place
    end_screen_pos: tuple[_Number, _Number]
    button: Literal["left", "middle", "right"]
    modifier: _Modifier
    owner: Literal[""] = ""


class _Updates(msgspec.Struct, forbid_unknown_fields=True):
    value: bool | int | float | _Name


class _Update(_Message, tag="GuiUpdateMessage"):
    uuid: _Name
    updates: _Updates


class _Key(_Message, tag="CommandTriggerMessage"):
    uuid: _Name


_DECODER = msgspec.msgpack.Decoder(_Camera | _Click | _Drag | _Update | _Key)


class Refused(Exception):
    """A message is not let through, and why."""


def accepted(raw: object, server: viser.ViserServer, client: int | None) -> bytes:
    """Read a message of a browser, and write down anew what was checked of it, for viser to read.

    Parameters
    ----------
    raw
        Message as received; text is never accepted.
    server
        Server with all elements of the page.
    client
        Number of the browser, by which elements of its own are found; None: it has none.

    Raises
    ------
    Refused
        If the page offers nothing of the kind.
    """
    try:
        message = _DECODER.decode(raw) if isinstance(raw, bytes) else None
    except (ValueError, RecursionError):
        message = None
    here = server.get_clients().get(client) if client is not None else None
    scopes = [server.gui] if here is None else [server.gui, here.gui]
    match message:
        case None:
            raise Refused("a message that is none of the page's")
        case _Drag(name=name, instance_index=index):
            node: Any = server.scene.get_handle_by_name(name)
            if not (node and node._impl.drag_cb and 0 <= index < len(node.batched_positions)):
                raise Refused(f"to drag {ascii(name)[:80]}, part {index}")
        case _Update(uuid=uuid, updates=updates):
            found = (scope._gui_input_handle_from_uuid.get(uuid) for scope in scopes)
            handle = next((each for each in found if each is not None), None)
            if handle is None or not _takes(handle, updates.value):
                name = "nothing" if handle is None else handle.label
                raise Refused(f"to set {name} to {ascii(updates.value)[:80]}")
        case _Key(uuid=uuid):
            keys = (scope._command_handle_from_uuid.get(uuid) for scope in scopes)
            if all(key is None or key.disabled for key in keys):
                raise Refused("a key that has no meaning")
    return msgspec.msgpack.encode(message)


def _takes(handle: Any, value: bool | float | str) -> bool:
    """Whether an element can be set to a value by hand."""
    if handle.disabled or not handle.visible:
        return False
    if isinstance(handle, viser.GuiCheckboxHandle):
        return isinstance(value, bool)
    if isinstance(handle, viser.GuiButtonHandle):
        return value is True
    if isinstance(handle, viser.GuiDropdownHandle):
        return value in handle.options
    if not isinstance(handle, viser.GuiSliderHandle | viser.GuiNumberHandle) or isinstance(value, bool | str):
        return False
    low, high = handle.min, handle.max
    if low is None or high is None or not low <= value <= high:
        return False
    return not isinstance(handle.value, int) or value == int(value)
