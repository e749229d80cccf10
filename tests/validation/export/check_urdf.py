"""The URDF and the SRDF in Pinocchio and Coal, against needlebench and against the MJCF model."""

import mujoco
import numpy as np
import pinocchio as pin
from common import JOINTS, LINK_OF, LINKS, Array, Cell, Failed, Tally

# Meshes come back in single precision; 1e-9 of what is left is Coal's own.
DISTANCE_M = 1e-7
FRAME_M = 1e-9
# Mass matrices, torques: sums and products of a dozen numbers below 100.
DYNAMICS = 1e-10


def load(path: str) -> tuple[pin.Model, pin.GeometryModel]:
    """Model and geometry with the pairs that the SRDF leaves."""
    model = pin.buildModelFromUrdf(str(path))
    if list(model.names)[1:] != JOINTS:
        raise Failed(f"joints {list(model.names)[1:]}")
    geometry = pin.buildGeomFromUrdf(
        model, str(path), pin.GeometryType.COLLISION, package_dirs=[str(path.parent)]
    )
    items = geometry.geometryObjects
    for a in range(len(items)):
        for b in range(a + 1, len(items)):
            # Links, not joints: what is bolted together may be measured too.
            if items[a].parentFrame != items[b].parentFrame:
                geometry.addCollisionPair(pin.CollisionPair(a, b))
    pin.removeCollisionPairs(model, geometry, str(path.with_suffix(".srdf")), False)
    return model, geometry


def states(model: pin.Model, path: str) -> dict[str, Array]:
    """Postures that the SRDF names."""
    pin.loadReferenceConfigurations(model, str(path.with_suffix(".srdf")), False)
    return {each.key(): each.data() for each in model.referenceConfigurations}


def joint_positions(model: pin.Model, q: Array) -> Array:
    """Pinocchio's configuration; a joint without limits has cosine and sine."""
    full = pin.neutral(model)
    for index, value in enumerate(q):
        joint = model.joints[index + 1]
        at = joint.idx_q
        full[at : at + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
    return full


def check_distances(cell: Cell, path: str, postures: list[Array], far: Tally) -> None:
    """The same pairs, and their distances by Coal."""
    model, geometry = load(path)
    data, placed = model.createData(), geometry.createData()
    for request in placed.distanceRequests:
        request.gjk_tolerance = request.epa_tolerance = 1e-9
        request.gjk_max_iterations = 1000
    frame = [model.frames[item.parentFrame].name for item in geometry.geometryObjects]
    pairs = [frozenset((frame[each.first], frame[each.second])) for each in geometry.collisionPairs]
    for number, q in enumerate(postures):
        ours = {
            frozenset(LINK_OF.get(name, name) for name in pair): each["distance_m"]
            for pair, each in cell.clearances(q).items()
        }
        if number == 0 and set(pairs) != set(ours):
            raise Failed(f"{cell.name}: pairs {set(pairs) ^ set(ours)}")
        pin.computeDistances(model, data, geometry, placed, joint_positions(model, q))
        theirs: dict[frozenset[str], float] = {}
        for pair, result in zip(pairs, placed.distanceResults, strict=True):
            theirs[pair] = min(theirs.get(pair, np.inf), result.min_distance)
        for pair, wanted in ours.items():
            where = f"{cell.name}, {' and '.join(sorted(pair))}: {wanted} against {theirs[pair]}"
            # Within each other, a mesh has no inside for Coal, and a capsule of three parts another depth.
            if wanted > 0.0:
                far.add(theirs[pair] - wanted, where)


def check_frames(cell: Cell, path: str, postures: list[Array], tally: Tally) -> None:
    """Flange and guide against `fk` and against the MJCF model; named states against its keyframes."""
    model, _ = load(path)
    data = model.createData()
    mjcf = mujoco.MjModel.from_xml_path(str(path.with_suffix(".xml")))
    theirs = mujoco.MjData(mjcf)
    named = states(model, path)
    keys = {mjcf.key(i).name: mjcf.key(i).qpos for i in range(mjcf.nkey)}
    if set(keys) != set(named):
        raise Failed(f"{cell.name}: postures {set(keys) ^ set(named)}")
    for name, q in keys.items():
        tally.add(np.abs(named[name] - joint_positions(model, q)).max(), f"{cell.name}: {name}")
    for q in postures:
        pin.framesForwardKinematics(model, data, joint_positions(model, q))
        wanted = cell.world_from_base_link() @ cell.base_link_from_flange(q)
        flange = data.oMf[model.getFrameId("tool0")].homogeneous
        tally.add(np.abs(flange - wanted).max(), f"{cell.name}: tool0")
        theirs.qpos[:] = q
        mujoco.mj_kinematics(mjcf, theirs)
        for site in range(mjcf.nsite):
            name = mjcf.site(site).name
            ours = data.oMf[model.getFrameId(name)]
            tally.add(np.abs(ours.translation - theirs.site_xpos[site]).max(), name)
            turn = ours.rotation - theirs.site_xmat[site].reshape(3, 3)
            tally.add(np.abs(turn).max(), f"turn of {name}")


def check_dynamics(cell: Cell, path: str, postures: list[Array], tally: Tally) -> None:
    """Mass matrix and gravity of Pinocchio from the URDF and of MuJoCo from the MJCF model."""
    model, _ = load(path)
    data = model.createData()
    mjcf = mujoco.MjModel.from_xml_path(str(path.with_suffix(".xml")))
    theirs = mujoco.MjData(mjcf)
    model.gravity.linear[:] = mjcf.opt.gravity
    moving = sum(mjcf.body_mass[mjcf.body(name).id] for name in LINKS)
    tally.add(sum(each.mass for each in model.inertias) - moving, f"{cell.name}: mass")
    # MuJoCo weighs the shapes of a link that does not say its mass.
    text = path.read_text().replace("package://", f"{path.parent}/")
    read = mujoco.MjModel.from_xml_string(text)
    tally.add(sum(read.body_mass) - moving, f"{cell.name}: mass by MuJoCo's reading")
    for q in postures:
        full = joint_positions(model, q)
        pin.crba(model, data, full)
        upper = np.triu(data.M)
        ours = upper + np.triu(upper, 1).T
        theirs.qpos[:], theirs.qvel[:] = q, 0.0
        mujoco.mj_forward(mjcf, theirs)
        mass = np.zeros((6, 6))
        mujoco.mj_fullM(mjcf, theirs, mass)
        tally.add(np.abs(ours + np.diag(mjcf.dof_armature) - mass).max(), f"{cell.name}: M")
        gravity = pin.computeGeneralizedGravity(model, data, full)
        tally.add(np.abs(gravity - theirs.qfrc_bias).max(), f"{cell.name}: gravity")
