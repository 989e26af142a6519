"""One scene as a deck of the host's spheres or of NURBS bodies: the same materials, contact models, walls and words.

    scene = Scene([Ball(radius=..., x=..)], model="hertz tangential history")
    host, ours = scene.run("sphere"), scene.run("nurbs")
"""
import functools
import json
import math
from dataclasses import dataclass, field

import deck

KINDS = ("model", "tangential", "cohesion", "rolling_friction")
DUMPED = "id x y z vx vy vz omegax omegay omegaz fx fy fz tqx tqy tqz"

# Values of `fix property/global` that serve every model, for two atom types: soft, bouncy, rough, sticky.
MATERIALS = {
    "youngsModulus": (5e6, 7e6), "poissonsRatio": (0.25, 0.3), "coefficientYieldRatio": (0.02, 0.02),
    "characteristicVelocity": 2.0, "rollingStiffness": 200.0, "overlapExponent": 1.5, "adhesionExponent": 1.5,
    "coefficientRestitution": ((0.6, 0.7), (0.7, 0.8)), "coefficientFriction": ((0.3, 0.35), (0.35, 0.4)),
    "cohesionEnergyDensity": 2e4, "coefficientRollingFriction": 0.1, "coefficientRollingViscousDamping": 0.1,
    "kn": 1e5, "kt": 3e4, "gamman": 200.0, "gammat": 100.0, "gamman_abs": 1.0, "gammat_abs": 1.0,
    "coefficientMaxElasticStiffness": 5.0, "coefficientAdhesionStiffness": 0.5, "coefficientPlasticityDepth": 0.02,
    "pullOffForce": 0.01, "LoadingStiffness": 1e5, "UnloadingStiffness": 5.0, "surfaceEnergy": 0.1,
    "FluidViscosity": 0.5, "FrictionViscosity": 0.5, "coeffFrictionStiffness": 0.3, "coeffRollingStiffness": 0.3,
    "MaximumRestitution": 0.8, "CriticalStokes": 10.0,
}
SCALARS = ("characteristicVelocity", "rollingStiffness", "overlapExponent", "adhesionExponent")


def materials(values, types=2):
    """The commands: a number is that of every type or pair, a tuple is per type, a tuple of tuples per pair."""
    lines = []
    for k, (name, value) in enumerate(values.items()):
        if name in SCALARS:
            words = f"scalar {value!r}"
        elif name in ("youngsModulus", "poissonsRatio", "coefficientYieldRatio"):
            each = value if isinstance(value, tuple) else (value, ) * types
            words = "peratomtype " + " ".join(map(repr, each))
        else:
            each = [x for row in value for x in row] if isinstance(value, tuple) else [value] * types**2
            words = f"peratomtypepair {types} " + " ".join(map(repr, each))
        lines.append(f"fix m{k} all property/global {name} {words}")
    return "\n".join(lines)


@dataclass
class Ball:
    radius: float
    x: tuple
    v: tuple = (0, 0, 0)
    omega: tuple = (0, 0, 0)
    density: float = 2500.0
    kind: int = 1


@functools.lru_cache(maxsize=None)
def ellipsoid(*axes):
    """Shape file of an exact ellipsoid, its inertia exact to round-off."""
    content = json.loads(deck.shape_file("ellipsoid", *axes))
    square = [a * a for a in axes]
    content["gyration"] = [(sum(square) - s) / 5 for s in square] + [0, 0, 0]
    return json.dumps(content)


@dataclass
class Scene:
    balls: list
    model: str  # the words behind `model`
    dt: float = 1e-5
    steps: int = 600
    every: int = 100  # steps between dumps
    floor: int = 0  # the plane z = 0 of this type; 0 for none
    types: int = 2
    gravity: float = 0.0
    box: float = 0.1
    materials: dict = field(default_factory=lambda: MATERIALS)
    tolerance: float = 1e-13
    commands: str = ""  # before the run
    end: str = ""       # instead of the run

    def words(self):
        """The model's names, and their settings: the host's walls want their geometry between."""
        words = ["model"] + self.model.split()
        k = 0
        while k < len(words) and words[k] in KINDS:
            k += 2
        return " ".join(words[:k]), " ".join(words[k:])

    def deck(self, kind):
        nurbs = kind == "nurbs"
        names, settings = self.words()
        text = ["units si", "hard_particles yes", "atom_style nurbs sphere.json" if nurbs else "atom_style granular", "boundary f f f",
                "newton off", "communicate single vel yes", "read_data bodies.data",
                f"neighbor {0.2 * min(ball.radius for ball in self.balls)!r} bin", "neigh_modify delay 0",
                materials(self.materials, self.types)]
        style = f"gran/nurbs tolerance {self.tolerance}" if nurbs else "gran"
        text += [f"pair_style {style} {names} {settings}", "pair_coeff * *"]
        if self.floor and nurbs:
            text.append(f"fix floor all wall/nurbs plane 0 0 0 0 0 1 type {self.floor} {names} {settings}")
        elif self.floor:
            text.append(f"fix floor all wall/gran {names} primitive type {self.floor} zplane 0.0 {settings}")
        if self.gravity:
            text.append(f"fix gravity all gravity {self.gravity} vector 0 0 -1")
        text += [f"fix move all {'nve/nurbs' if nurbs else 'nve/sphere'}", f"timestep {self.dt!r}",
                 f"thermo {self.steps}", f"dump d all custom {self.every} out.dump {DUMPED}",
                 'dump_modify d format "%d' + " %.17g" * 15 + '"', self.commands,
                 self.end or f"run {self.steps}"]
        return "\n".join(text) + "\n"

    def files(self, kind):
        nurbs = kind == "nurbs"
        atoms, velocities = [], []
        for k, b in enumerate(self.balls):
            body = (1, float(b.radius), b.density) if nurbs else (2.0 * b.radius, b.density)
            turn = (1.0, 0.0, 0.0, 0.0) if nurbs else ()
            atoms.append((k + 1, b.kind, *body, *map(float, b.x), *turn))
            velocities.append((k + 1, *map(float, (*b.v, *b.omega))))
        files = {"bodies.data": deck.data_file(atoms, velocities, ((-self.box, self.box), ) * 3, self.types)}
        if nurbs:
            files["sphere.json"] = ellipsoid(1.0, 1.0, 1.0)
        return files

    def run(self, kind, **options):
        run = deck.run_ok(self.deck(kind), files=self.files(kind), **options)
        run.frames = run.dump("out.dump") if (run.path / "out.dump").exists() else []
        return run


def ball_mass(ball):
    return 4 / 3 * math.pi * ball.radius**3 * ball.density
