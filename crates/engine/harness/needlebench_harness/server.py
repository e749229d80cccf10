"""Answers the client's requests, one after the other."""

import gc
import platform
import struct
import sys
from typing import Final

import mujoco
import numpy as np

from needlebench_harness.plant import Floats, Model, Plant, Port
from needlebench_harness.protocol import (
    GROUP,
    HEADER,
    INBOX_BYTES,
    PLANT,
    U32,
    VERSION,
    Answer,
    Channel,
    ProtocolError,
    Request,
    RequestError,
    pack_string,
    pack_strings,
)

LOADED: Final = struct.Struct("<IIIIIId")
DYNAMICS: Final = struct.Struct("<IIII")
DISTANCE: Final = struct.Struct("<IIIId")
DISTANCE_ANSWER: Final = struct.Struct("<7d")
SECONDS: Final = struct.Struct("<d")


class Single:
    """A plant that is stepped alone, and the answer that its state goes out in."""

    def __init__(self, *, plant: Plant, inbox: bytearray) -> None:
        """Make the answer; the torques of each request will lie in `inbox`."""
        self.plant = plant
        self.request_bytes = PLANT.size + plant.torque_bytes
        self.answer = bytearray(HEADER.size + plant.state_bytes)
        HEADER.pack_into(self.answer, 0, Answer.STATE, plant.state_bytes)
        self.port = Port(
            plant=plant,
            torques_from=inbox,
            torques_at=HEADER.size + PLANT.size,
            state_to=self.answer,
            state_at=HEADER.size,
        )


class Group:
    """Plants that are stepped with one request, and the answer that their states go out in."""

    def __init__(self, *, plants: list[Plant], inbox: bytearray) -> None:
        """Make the answer; the torques of each request will lie in `inbox`."""
        head_bytes = GROUP.size + PLANT.size * len(plants)
        self.request_bytes = head_bytes + sum(plant.torque_bytes for plant in plants)
        if HEADER.size + self.request_bytes > INBOX_BYTES:
            raise RequestError(f"{len(plants)} plants are more than one request can carry")
        payload_bytes = GROUP.size + sum(plant.state_bytes for plant in plants)
        self.answer = bytearray(HEADER.size + payload_bytes)
        HEADER.pack_into(self.answer, 0, Answer.GROUP_STATE, payload_bytes)
        GROUP.pack_into(self.answer, HEADER.size, len(plants), 0)
        self._contacts = struct.Struct("<" + "4xI" * len(plants))
        self.ports: list[Port] = []
        torques_at = HEADER.size + head_bytes
        state_at = HEADER.size + GROUP.size
        for plant in plants:
            self.ports.append(
                Port(
                    plant=plant,
                    torques_from=inbox,
                    torques_at=torques_at,
                    state_to=self.answer,
                    state_at=state_at,
                )
            )
            torques_at += plant.torque_bytes
            state_at += plant.state_bytes

    def step(self, payload: memoryview, warnings: list[str]) -> list[tuple[int, str]]:
        """Step every plant; return the places of those that failed, and why."""
        failures: list[tuple[int, str]] = []
        flags = self._contacts.unpack_from(payload, GROUP.size)
        for place, (port, contacts) in enumerate(zip(self.ports, flags, strict=True)):
            port.step(contacts)
            if warnings:
                failures.append((place, joined(warnings)))
        return failures

    def answer_with(self, failures: list[tuple[int, str]]) -> bytes:
        """Return the answer with the failures behind the states."""
        parts = [bytes(self.answer[HEADER.size + GROUP.size :])]
        for place, text in failures:
            parts += [U32.pack(place), pack_string(text)]
        payload = GROUP.pack(len(self.ports), len(failures)) + b"".join(parts)
        return HEADER.pack(Answer.GROUP_STATE, len(payload)) + payload


class Server:
    """Holds the loaded plants and serves one client."""

    def __init__(self, *, channel: Channel) -> None:
        """Route MuJoCo's warnings here, and keep the collector out of the step loop."""
        self._channel = channel
        self._plants: list[Single] = []
        self._groups: dict[bytes, Group] = {}
        self._warnings: list[str] = []
        mujoco.set_mju_user_warning(self._warnings.append)
        gc.freeze()
        gc.disable()

    def serve(self) -> None:
        """Answer requests until the client quits or closes the pipe."""
        read = self._channel.read
        step = self._step
        step_group = self._step_group
        while (request := read()) is not None:
            kind, payload = request
            try:
                if kind == Request.STEP:
                    step(payload)
                elif kind == Request.STEP_GROUP:
                    step_group(payload)
                elif kind == Request.QUIT:
                    return
                else:
                    self._serve_rare(kind, payload)
            except (ProtocolError, BrokenPipeError):
                raise
            except RequestError as error:
                self._channel.write_text(Answer.ERROR, str(error))
            except Exception as error:  # noqa: BLE001 - whatever MuJoCo raises, the client shall read
                self._channel.write_text(Answer.ERROR, f"{type(error).__name__}: {error}")

    def _step(self, payload: memoryview) -> None:
        single = self._single(payload)
        if len(payload) != single.request_bytes:
            expected = single.request_bytes
            raise ProtocolError(f"a step of {len(payload)} bytes instead of {expected}")
        single.port.step(PLANT.unpack_from(payload)[1])
        if self._warnings:
            raise RequestError(joined(self._warnings))
        self._channel.write_frame(single.answer)

    def _step_group(self, payload: memoryview) -> None:
        try:
            count: int = GROUP.unpack_from(payload)[0]
            # Every second number names a plant; the others change from step to step.
            named = bytes(payload[GROUP.size : GROUP.size + PLANT.size * count].cast("I")[::2])
        except (struct.error, TypeError):
            raise ProtocolError(f"{len(payload)} bytes cannot name the plants") from None
        group = self._groups.get(named)
        if group is None:
            group = self._groups[named] = self._new_group(payload, count)
        if len(payload) != group.request_bytes:
            expected = group.request_bytes
            raise ProtocolError(f"a step of {len(payload)} bytes instead of {expected}")
        failures = group.step(payload, self._warnings)
        self._channel.write_frame(group.answer_with(failures) if failures else group.answer)

    def _new_group(self, payload: memoryview, count: int) -> Group:
        places = range(GROUP.size, GROUP.size + PLANT.size * count, PLANT.size)
        plants = [self._single(payload[at:]).plant for at in places]
        return Group(plants=plants, inbox=self._channel.inbox)

    def _serve_rare(self, kind: int, payload: memoryview) -> None:
        if kind == Request.HELLO:
            self._hello(payload)
        elif kind == Request.LOAD:
            self._load(payload)
        elif kind == Request.RESET:
            self._reset(payload)
        elif kind == Request.INVERSE:
            self._inverse(payload)
        elif kind == Request.DISTANCE:
            self._distance(payload)
        elif kind == Request.COPY:
            self._copy(payload)
        elif kind == Request.REPLAY:
            self._replay(payload)
        elif kind == Request.CLEAR:
            self._clear()
        else:
            raise ProtocolError(f"unknown request kind {kind}")

    def _hello(self, payload: memoryview) -> None:
        (version,) = unpack(U32, payload)
        if version != VERSION:
            raise ProtocolError(f"client speaks version {version}, harness version {VERSION}")
        versions = [mujoco.mj_versionString(), platform.python_version(), np.__version__]
        self._channel.write(Answer.WELCOME, U32.pack(VERSION) + pack_strings(versions))

    def _load(self, payload: memoryview) -> None:
        (site_bytes,) = U32.unpack_from(payload)
        texts = payload[U32.size :]
        if site_bytes > len(texts):
            raise ProtocolError(f"a site name of {site_bytes} bytes in {len(texts)}")
        model = Model(
            mjcf=str(texts[site_bytes:], "utf-8"), observed_site=str(texts[:site_bytes], "utf-8")
        )
        # What the compiler merely warns of is for the log; the client gave the model.
        if self._warnings:
            print(joined(self._warnings), file=sys.stderr)
        index = self._add(model)
        mj = model.mj
        counts = (index, mj.nq, mj.nv, mj.njnt, mj.nbody, mj.ngeom)
        self._channel.write(
            Answer.LOADED,
            LOADED.pack(*counts, mj.opt.timestep)
            + pack_strings(model.names(mujoco.mjtObj.mjOBJ_JOINT, mj.njnt))
            + pack_strings(model.names(mujoco.mjtObj.mjOBJ_BODY, mj.nbody))
            + pack_strings(model.names(mujoco.mjtObj.mjOBJ_GEOM, mj.ngeom)),
        )

    def _clear(self) -> None:
        self._groups.clear()
        self._plants.clear()
        # Only now: models and plants may refer to each other, and nobody waits for a step.
        gc.collect()
        self._channel.write(Answer.CLEARED, b"")

    def _add(self, model: Model) -> int:
        index = len(self._plants)
        plant = Plant(index=index, model=model)
        self._plants.append(Single(plant=plant, inbox=self._channel.inbox))
        return index

    def _copy(self, payload: memoryview) -> None:
        index = self._add(self._single(payload).plant.model)
        self._channel.write(Answer.COPIED, U32.pack(index))

    def _replay(self, payload: memoryview) -> None:
        plant = self._single(payload).plant
        contacts: int = PLANT.unpack_from(payload)[1]
        if not plant.torque_bytes or (len(payload) - PLANT.size) % plant.torque_bytes:
            raise ProtocolError(f"{len(payload)} bytes are no rows of torques")
        torques = np.frombuffer(payload, np.float64, -1, PLANT.size).reshape(-1, plant.model.mj.nv)
        elapsed = plant.replay(torques, contacts=contacts)
        if self._warnings:
            raise RequestError(joined(self._warnings))
        state = plant.qpos.tobytes() + plant.qvel.tobytes()
        self._channel.write(Answer.REPLAYED, SECONDS.pack(elapsed) + state)

    def _reset(self, payload: memoryview) -> None:
        single = self._single(payload)
        model = single.plant.model.mj
        qpos, qvel = split(payload, model.nq, model.nv)
        single.port.reset(qpos=qpos, qvel=qvel)
        if self._warnings:
            raise RequestError(joined(self._warnings))
        self._channel.write_frame(single.answer)

    def _inverse(self, payload: memoryview) -> None:
        plant = self._single(payload).plant
        model = plant.model.mj
        qpos, qvel, qacc = split(payload, model.nq, model.nv, model.nv)
        dynamics = plant.inverse(qpos=qpos, qvel=qvel, qacc=qacc)
        if self._warnings:
            raise RequestError(joined(self._warnings))
        arrays = (
            dynamics.torque,
            dynamics.mass_matrix,
            dynamics.bias,
            dynamics.gravity,
            dynamics.xpos,
            dynamics.xmat,
        )
        counts = DYNAMICS.pack(plant.index, model.nv, model.nbody, 0)
        self._channel.write(Answer.DYNAMICS, counts + b"".join(a.tobytes() for a in arrays))

    def _distance(self, payload: memoryview) -> None:
        plant = self._single(payload).plant
        _, _, geom_a, geom_b, cutoff = unpack(DISTANCE, payload)
        distance, fromto = plant.distance(geom_a=geom_a, geom_b=geom_b, cutoff=cutoff)
        self._channel.write(Answer.DISTANCE, DISTANCE_ANSWER.pack(distance, *fromto.tolist()))

    def _single(self, payload: memoryview) -> Single:
        try:
            index: int = PLANT.unpack_from(payload)[0]
        except struct.error:
            raise ProtocolError(f"{len(payload)} bytes cannot name a plant") from None
        try:
            return self._plants[index]
        except IndexError:
            raise ProtocolError(f"plant {index} of {len(self._plants)}") from None


def joined(warnings: list[str]) -> str:
    """Take what MuJoCo warned of."""
    text = "; ".join(warning.strip() for warning in warnings)
    warnings.clear()
    return text


def unpack(layout: struct.Struct, payload: memoryview) -> tuple[int, ...]:
    """Read a payload of fixed layout."""
    if len(payload) != layout.size:
        raise ProtocolError(f"a payload of {len(payload)} bytes instead of {layout.size}")
    return layout.unpack(payload)


def split(payload: memoryview, *counts: int) -> list[Floats]:
    """Read arrays of f64 that follow a plant index."""
    expected = PLANT.size + 8 * sum(counts)
    if len(payload) != expected:
        raise ProtocolError(f"a payload of {len(payload)} bytes instead of {expected}")
    numbers = np.frombuffer(payload, np.float64, -1, PLANT.size)
    return np.split(numbers, np.cumsum(counts)[:-1])
