"""Answers the client's requests, one after the other."""

import gc
import platform
import struct
import sys
from typing import Final

import mujoco
import numpy as np

from needlebench_harness.plant import Floats, Plant
from needlebench_harness.protocol import (
    PLANT,
    U32,
    VERSION,
    Answer,
    Channel,
    ProtocolError,
    Request,
    RequestError,
    pack_strings,
)

LOADED: Final = struct.Struct("<IIIIIId")
DYNAMICS: Final = struct.Struct("<IIII")
DISTANCE: Final = struct.Struct("<IIIId")
DISTANCE_ANSWER: Final = struct.Struct("<7d")


class Server:
    """Holds the loaded plants and serves one client."""

    def __init__(self, *, channel: Channel) -> None:
        """Route MuJoCo's warnings here, and keep the collector out of the step loop."""
        self._channel = channel
        self._plants: list[Plant] = []
        self._warnings: list[str] = []
        mujoco.set_mju_user_warning(self._warnings.append)
        gc.freeze()
        gc.disable()

    def serve(self) -> None:
        """Answer requests until the client quits or closes the pipe."""
        read = self._channel.read
        step = self._step
        while (request := read()) is not None:
            kind, payload = request
            try:
                if kind == Request.STEP:
                    step(payload)
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
        plant = self._plant(payload)
        if len(payload) != plant.step_request_bytes:
            expected = plant.step_request_bytes
            raise ProtocolError(f"a step of {len(payload)} bytes instead of {expected}")
        plant.step()
        if self._warnings:
            raise RequestError(self._take_warnings())
        self._channel.write_frame(plant.answer)

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
        index = len(self._plants)
        plant = Plant(
            index=index,
            mjcf=str(texts[site_bytes:], "utf-8"),
            observed_site=str(texts[:site_bytes], "utf-8"),
            inbox=self._channel.inbox,
        )
        # What the compiler merely warns of is for the log; the client gave the model.
        if self._warnings:
            print(self._take_warnings(), file=sys.stderr)
        self._plants.append(plant)
        model = plant.model
        counts = (index, model.nq, model.nv, model.njnt, model.nbody, model.ngeom)
        self._channel.write(
            Answer.LOADED,
            LOADED.pack(*counts, model.opt.timestep)
            + pack_strings(plant.names(mujoco.mjtObj.mjOBJ_JOINT, model.njnt))
            + pack_strings(plant.names(mujoco.mjtObj.mjOBJ_BODY, model.nbody))
            + pack_strings(plant.names(mujoco.mjtObj.mjOBJ_GEOM, model.ngeom)),
        )

    def _reset(self, payload: memoryview) -> None:
        plant = self._plant(payload)
        qpos, qvel = split(payload, plant.model.nq, plant.model.nv)
        plant.reset(qpos=qpos, qvel=qvel)
        if self._warnings:
            raise RequestError(self._take_warnings())
        self._channel.write_frame(plant.answer)

    def _inverse(self, payload: memoryview) -> None:
        plant = self._plant(payload)
        model = plant.model
        qpos, qvel, qacc = split(payload, model.nq, model.nv, model.nv)
        dynamics = plant.inverse(qpos=qpos, qvel=qvel, qacc=qacc)
        if self._warnings:
            raise RequestError(self._take_warnings())
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
        plant = self._plant(payload)
        _, _, geom_a, geom_b, cutoff = unpack(DISTANCE, payload)
        distance, fromto = plant.distance(geom_a=geom_a, geom_b=geom_b, cutoff=cutoff)
        self._channel.write(Answer.DISTANCE, DISTANCE_ANSWER.pack(distance, *fromto.tolist()))

    def _plant(self, payload: memoryview) -> Plant:
        try:
            index: int = PLANT.unpack_from(payload)[0]
        except struct.error:
            raise ProtocolError(f"{len(payload)} bytes cannot name a plant") from None
        try:
            return self._plants[index]
        except IndexError:
            raise ProtocolError(f"plant {index} of {len(self._plants)}") from None

    def _take_warnings(self) -> str:
        text = "; ".join(warning.strip() for warning in self._warnings)
        self._warnings.clear()
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
