"""One MuJoCo model with its state, and the numbers that the client reads from it."""

import math
import struct
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
import numpy.typing as npt

from needlebench_harness.protocol import HEADER, INBOX_BYTES, PLANT, Answer, RequestError

Floats = npt.NDArray[np.float64]

CONTACTS: Final = struct.Struct("<Iiiii")
"""Number of contacts, the two geoms of the strongest one, the two geoms of the deepest one."""

NO_PAIR: Final = (-1, -1)

STATE_FIXED: Final = struct.Struct("<IIiiii")
"""Plant index and `CONTACTS`, in front of the numbers of a state."""

CONTACTS_OFFSET: Final = HEADER.size + 4
TIME, PENETRATION, FORCE, SITE_POSITION, SITE_ROTATION, JOINTS = 0, 1, 2, 3, 6, 15
"""Where the numbers of a state begin, counted in f64."""


@dataclass(frozen=True, kw_only=True)
class InverseDynamics:
    """Rigid-body dynamics at one state, without contacts, limits, friction or passive forces."""

    torque: Floats
    mass_matrix: Floats
    bias: Floats
    gravity: Floats
    xpos: Floats
    xmat: Floats


class Plant:
    """A compiled model, its running state, and the preallocated answer of a step."""

    def __init__(self, *, index: int, mjcf: str, observed_site: str, inbox: bytearray) -> None:
        """Compile `mjcf`; `inbox` is where the torques of each step request will lie."""
        self.index = index
        self.model = mujoco.MjModel.from_xml_string(mjcf)
        self.data = mujoco.MjData(self.model)
        self._scratch: mujoco.MjData | None = None
        model, data = self.model, self.data
        site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, observed_site)
        if site < 0:
            raise RequestError(f"the model has no site named {observed_site!r}")
        torques_at = HEADER.size + PLANT.size
        if torques_at + 8 * model.nv > INBOX_BYTES:
            raise RequestError(f"{model.nv} degrees of freedom are more than a step can carry")

        # Views made once: creating one costs as much as copying through it.
        self._qpos = data.qpos
        self._qvel = data.qvel
        self._applied = data.qfrc_applied
        self._site_xpos = data.site_xpos[site]
        self._site_xmat = data.site_xmat[site]
        self._torques = np.frombuffer(inbox, np.float64, model.nv, torques_at)
        self._wrench: Floats = np.zeros(6)
        self._had_contacts = False

        numbers = JOINTS + model.nq + model.nv
        payload_bytes = STATE_FIXED.size + 8 * numbers
        self.answer = bytearray(HEADER.size + payload_bytes)
        HEADER.pack_into(self.answer, 0, Answer.STATE, payload_bytes)
        STATE_FIXED.pack_into(self.answer, HEADER.size, index, 0, *NO_PAIR, *NO_PAIR)
        out = np.frombuffer(self.answer, np.float64, numbers, HEADER.size + STATE_FIXED.size)
        self._out = out
        self._out_position = out[SITE_POSITION:SITE_ROTATION]
        self._out_rotation = out[SITE_ROTATION:JOINTS]
        self._out_qpos = out[JOINTS : JOINTS + model.nq]
        self._out_qvel = out[JOINTS + model.nq :]
        self.step_request_bytes = PLANT.size + 8 * model.nv

    def reset(self, *, qpos: Floats, qvel: Floats) -> None:
        """Set the state at time zero and fill `answer` from it."""
        mujoco.mj_resetData(self.model, self.data)
        self._qpos[:] = qpos
        self._qvel[:] = qvel
        mujoco.mj_forward(self.model, self.data)
        self._observe()

    def step(self) -> None:
        """Advance one time step under the torques in the inbox and fill `answer`.

        The answer's pose belongs to its `qpos`; its contacts are those that acted during the step,
        which MuJoCo finds at the state that the step begins with.
        """
        data = self.data
        self._applied[:] = self._torques
        mujoco.mj_step(self.model, data)
        # A step leaves site poses at the state before integration.
        mujoco.mj_kinematics(self.model, data)
        self._observe()

    def _observe(self) -> None:
        data = self.data
        self._out[TIME] = data.time
        self._out_position[:] = self._site_xpos
        self._out_rotation[:] = self._site_xmat
        self._out_qpos[:] = self._qpos
        self._out_qvel[:] = self._qvel
        if data.ncon or self._had_contacts:
            self._observe_contacts()

    def _observe_contacts(self) -> None:
        data = self.data
        count = 0
        total = strongest = 0.0
        deepest = -math.inf
        strongest_pair = deepest_pair = NO_PAIR
        for index in range(data.ncon):
            contact = data.contact[index]
            depth = -float(contact.dist)
            mujoco.mj_contactForce(self.model, data, index, self._wrench)
            force = abs(float(self._wrench[0]))
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
        CONTACTS.pack_into(self.answer, CONTACTS_OFFSET, count, *strongest_pair, *deepest_pair)
        self._out[PENETRATION] = max(deepest, 0.0)
        self._out[FORCE] = total
        self._had_contacts = data.ncon > 0

    def inverse(self, *, qpos: Floats, qvel: Floats, qacc: Floats) -> InverseDynamics:
        """Evaluate the rigid-body dynamics at a state of its own; the running state stays."""
        model = self.model
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
        for geom in (geom_a, geom_b):
            if not 0 <= geom < self.model.ngeom:
                raise RequestError(f"geom {geom} of {self.model.ngeom}")
        fromto: Floats = np.zeros(6)
        distance = mujoco.mj_geomDistance(self.model, self.data, geom_a, geom_b, cutoff, fromto)
        return distance, fromto

    def names(self, kind: mujoco.mjtObj, count: int) -> list[str]:
        """Names of all objects of a kind, empty where the model gives none."""
        return [mujoco.mj_id2name(self.model, kind, index) or "" for index in range(count)]
