"""One MuJoCo model with its state, and the numbers that the client reads from it."""

import math
import struct
import time
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
import numpy.typing as npt
from mujoco import mj_step1, mj_step2

from needlebench_harness.protocol import HEADER, INBOX_BYTES, PLANT, RequestError

Floats = npt.NDArray[np.float64]

CONTACTS: Final = struct.Struct("<Iiiii")
"""Number of contacts, the two geoms of the strongest one, the two geoms of the deepest one."""

NO_PAIR: Final = (-1, -1)

STATE_FIXED: Final = struct.Struct("<IIiiii")
"""Plant index and `CONTACTS`, in front of the numbers of a state."""

CONTACTS_OFFSET: Final = 4
TIME, PENETRATION, FORCE, SITE_POSITION, SITE_ROTATION, JOINTS = 0, 1, 2, 3, 6, 15
"""Where the numbers of a state begin, counted in f64."""

NO_CONTACTS: Final = int(mujoco.mjtDisableBit.mjDSBL_CONTACT)


@dataclass(frozen=True, kw_only=True)
class InverseDynamics:
    """Rigid-body dynamics at one state, without contacts, limits, friction or passive forces."""

    torque: Floats
    mass_matrix: Floats
    bias: Floats
    gravity: Floats
    xpos: Floats
    xmat: Floats


class Model:
    """A compiled model, which any number of plants share."""

    def __init__(self, *, mjcf: str, observed_site: str) -> None:
        """Compile `mjcf`."""
        self.mj = mujoco.MjModel.from_xml_string(mjcf)
        self.site = mujoco.mj_name2id(self.mj, mujoco.mjtObj.mjOBJ_SITE, observed_site)
        if self.site < 0:
            raise RequestError(f"the model has no site named {observed_site!r}")
        if HEADER.size + PLANT.size + 8 * self.mj.nv > INBOX_BYTES:
            raise RequestError(f"{self.mj.nv} degrees of freedom are more than a step can carry")
        self._options = self.mj.opt
        self._own_flags = int(self.mj.opt.disableflags)
        self.detects = not self._own_flags & NO_CONTACTS

    def detect_contacts(self, *, wanted: bool) -> None:
        """Have the next position stage find contacts, or not."""
        if wanted != self.detects:
            flags = self._own_flags if wanted else self._own_flags | NO_CONTACTS
            self._options.disableflags = flags
            self.detects = wanted

    def names(self, kind: mujoco.mjtObj, count: int) -> list[str]:
        """Names of all objects of a kind, empty where the model gives none."""
        return [mujoco.mj_id2name(self.mj, kind, index) or "" for index in range(count)]


class Plant:
    """A running state of a model.

    Between two steps, MuJoCo's position and velocity stages belong to the present `qpos` and
    `qvel`. MuJoCo's own step leaves them at the state before integration; beginning it with its
    second half and ending it with the first half of the next one has them up to date without
    computing anything twice. The bits are the same.
    """

    def __init__(self, *, index: int, model: Model) -> None:
        """Prepare the memory of a state."""
        self.index = index
        self.model = model
        self.data = mujoco.MjData(model.mj)
        self._scratch: mujoco.MjData | None = None
        # Views made once: creating one costs as much as copying through it.
        data = self.data
        self.qpos = data.qpos
        self.qvel = data.qvel
        self.applied = data.qfrc_applied
        self.site_xpos = data.site_xpos[model.site]
        self.site_xmat = data.site_xmat[model.site]
        self.wrench: Floats = np.zeros(6)
        self.looked = True
        """Whether the position stage at the present state has looked for contacts."""
        self.state_bytes = STATE_FIXED.size + 8 * (JOINTS + model.mj.nq + model.mj.nv)
        self.torque_bytes = 8 * model.mj.nv

    def reset(self, *, qpos: Floats, qvel: Floats) -> None:
        """Set the state at time zero."""
        self.model.detect_contacts(wanted=True)
        mujoco.mj_resetData(self.model.mj, self.data)
        self.qpos[:] = qpos
        self.qvel[:] = qvel
        mujoco.mj_forward(self.model.mj, self.data)
        self.looked = True

    def replay(self, torques: Floats, *, contacts: int) -> float:
        """Run MuJoCo's own step over rows of torques, with nothing else; return the time, s.

        The yardstick for what a client in lock-step pays.
        """
        model, data, applied, step = self.model.mj, self.data, self.applied, mujoco.mj_step
        rows = list(torques)
        self.model.detect_contacts(wanted=contacts != 0)
        started = time.perf_counter()
        for row in rows:
            applied[:] = row
            step(model, data)
        elapsed = time.perf_counter() - started
        self.model.detect_contacts(wanted=True)
        mujoco.mj_step1(model, data)
        self.looked = True
        return elapsed

    def inverse(self, *, qpos: Floats, qvel: Floats, qacc: Floats) -> InverseDynamics:
        """Evaluate the rigid-body dynamics at a state of its own; the running state stays."""
        model = self.model.mj
        if self._scratch is None:
            self._scratch = mujoco.MjData(model)
        scratch = self._scratch
        mujoco.mj_resetData(model, scratch)
        scratch.qpos[:] = qpos
        mujoco.mj_forward(model, scratch)
        gravity = scratch.qfrc_bias.copy()
        scratch.qvel[:] = qvel
        mujoco.mj_forward(model, scratch)
        bias = scratch.qfrc_bias.copy()
        mass_matrix: Floats = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, scratch, mass_matrix)
        return InverseDynamics(
            torque=mass_matrix @ qacc + bias,
            mass_matrix=mass_matrix,
            bias=bias,
            gravity=gravity,
            xpos=scratch.xpos,
            xmat=scratch.xmat,
        )

    def distance(self, *, geom_a: int, geom_b: int, cutoff: float) -> tuple[float, Floats]:
        """Signed distance of two geoms at the running state, and the segment between them.

        Beyond `cutoff` the distance is `cutoff` and the segment zero.
        """
        model = self.model.mj
        for geom in (geom_a, geom_b):
            if not 0 <= geom < model.ngeom:
                raise RequestError(f"geom {geom} of {model.ngeom}")
        fromto: Floats = np.zeros(6)
        distance = mujoco.mj_geomDistance(model, self.data, geom_a, geom_b, cutoff, fromto)
        return distance, fromto


def doubles(buffer: bytearray, at: int, count: int) -> "memoryview[float]":
    """View part of a buffer as numbers."""
    return memoryview(buffer)[at : at + 8 * count].cast("d")


class Port:
    """Where a plant's torques come from and its states go to, in buffers that are reused.

    Numbers are copied from one memory view to another, which takes a third of what it takes between
    arrays; the views are laid once, since making one costs as much as copying through it.
    """

    def __init__(
        self,
        *,
        plant: Plant,
        torques_from: bytearray,
        torques_at: int,
        state_to: bytearray,
        state_at: int,
    ) -> None:
        """Lay the views."""
        self.plant = plant
        model = plant.model.mj
        self._torques = doubles(torques_from, torques_at, model.nv)
        STATE_FIXED.pack_into(state_to, state_at, plant.index, 0, *NO_PAIR, *NO_PAIR)
        self._answer = state_to
        self._contacts_at = state_at + CONTACTS_OFFSET
        numbers = JOINTS + model.nq + model.nv
        out = doubles(state_to, state_at + STATE_FIXED.size, numbers)
        self._out = out
        self._out_position = out[SITE_POSITION:SITE_ROTATION]
        self._out_rotation = out[SITE_ROTATION:JOINTS]
        self._out_qpos = out[JOINTS : JOINTS + model.nq]
        self._out_qvel = out[JOINTS + model.nq :]
        self._applied = plant.applied.data
        self._position = plant.site_xpos.data
        self._rotation = plant.site_xmat.data
        self._qpos = plant.qpos.data
        self._qvel = plant.qvel.data
        self._shows_contacts = False

    def reset(self, *, qpos: Floats, qvel: Floats) -> None:
        """Set the plant's state at time zero and write it out."""
        self.plant.reset(qpos=qpos, qvel=qvel)
        self._observe_contacts()
        self._observe(self.plant.data)

    def step(self, contacts: int) -> None:
        """Advance one time step under the torques and write the state out.

        With `contacts` 0 the client vouches that nothing can touch, and nobody looks.
        The pose belongs to the reported `qpos`; the contacts are those that acted during the step,
        which are found at the state that the step begins with.
        """
        plant = self.plant
        shared, data = plant.model, plant.data
        model = shared.mj
        wanted = contacts != 0
        if wanted != shared.detects:
            shared.detect_contacts(wanted=wanted)
        if wanted and not plant.looked:
            mj_step1(model, data)
            plant.looked = True
        self._applied[:] = self._torques
        mj_step2(model, data)
        if plant.looked or self._shows_contacts:
            self._observe_contacts()
        mj_step1(model, data)
        plant.looked = wanted
        self._observe(data)

    def _observe(self, data: mujoco.MjData) -> None:
        self._out[TIME] = data.time
        self._out_position[:] = self._position
        self._out_rotation[:] = self._rotation
        self._out_qpos[:] = self._qpos
        self._out_qvel[:] = self._qvel

    def _observe_contacts(self) -> None:
        data = self.plant.data
        found = data.ncon
        if not found and not self._shows_contacts:
            return
        model = self.plant.model.mj
        wrench = self.plant.wrench
        count = 0
        total = strongest = 0.0
        deepest = -math.inf
        strongest_pair = deepest_pair = NO_PAIR
        for index in range(found):
            contact = data.contact[index]
            depth = -float(contact.dist)
            mujoco.mj_contactForce(model, data, index, wrench)
            force = abs(float(wrench[0]))
            # Within a margin a contact can bear force before it touches.
            if depth < 0.0 and force == 0.0:
                continue
            pair = (int(contact.geom[0]), int(contact.geom[1]))
            count += 1
            total += force
            if force > strongest:
                strongest, strongest_pair = force, pair
            if depth > deepest:
                deepest, deepest_pair = depth, pair
        CONTACTS.pack_into(self._answer, self._contacts_at, count, *strongest_pair, *deepest_pair)
        self._out[PENETRATION] = max(deepest, 0.0)
        self._out[FORCE] = total
        self._shows_contacts = found > 0
