//! Every section and key of the input.

mod particles;
mod routine;

pub use particles::{MATERIAL, MAXWELL, MOTION, RADIUS, SPECIES};
pub use routine::QUASI_STATIC;

use super::schema::{Default, Key, Kind, Range, Table, key};
use crate::force::registry::Role;
use crate::units::Dimension;

use Default::{Absent, Derived, Required};

const fn number(dimension: Dimension, range: Range) -> Kind {
    Kind::Number(dimension, range)
}

const fn axes(dimension: Dimension, uniform: bool) -> Kind {
    Kind::Axes { dimension, range: Range::ANY, uniform }
}

const COEFFICIENT: Kind = number(Dimension::NONE, Range::NOT_NEGATIVE);
const ZERO: Default = Default::Number(0.0);

/// The top level.
pub static ROOT: Table = Table {
    meaning: "The run as a whole.",
    keys: &[
        key("title", Kind::Text, Derived("name of the file"), "Name of the run in titles and plots."),
        key(
            "seed",
            Kind::Integer(0),
            Default::Integer(1),
            "Seed of every random draw: packing, radii, initial velocities.",
        ),
        key(
            "particles",
            Kind::Integer(1),
            Absent,
            "Number of particles of all species together; needed where species give a `fraction`.",
        ),
        key("gravity", axes(Dimension::ACCELERATION, false), ZERO, "Uniform body acceleration."),
        key("cell", Kind::Table(&CELL), Derived("all its defaults"), "The cell."),
        key("material", Kind::List(&MATERIAL), Required, "Materials."),
        key("species", Kind::List(&SPECIES), Required, "Particle species."),
        key("contact", Kind::Table(&CONTACT), Required, "Contact laws of every pair of materials."),
        key("pair", Kind::List(&PAIR), Absent, "What a named pair of materials does differently."),
        key(
            "packing",
            Kind::OneOf(&PACKING, None),
            Default::Word("random_close"),
            "How the initial positions are made.",
        ),
        key("load", Kind::Table(&LOAD), Derived("all its defaults"), "What all stages share."),
        key("stage", Kind::List(&STAGE), Required, "The load programme, one stage after the other."),
        key("time_step", Kind::OneOf(&TIME_STEP, Some("fixed")), Default::Word("automatic"), "The time step."),
        key("output", Kind::Table(&OUTPUT), Derived("all its defaults"), "What is written, and how often."),
        key(
            "parallel",
            Kind::Table(&PARALLEL),
            Derived("all its defaults"),
            "Ranks, threads, lists; no effect on results.",
        ),
    ],
};

/// `[cell]`.
pub static CELL: Table = Table {
    meaning: "A box with its low corner at the origin. Give `sides`, or `solid_fraction`, or neither \
              (random close packing then sizes the box by where it jams, drop and roll by the height of the bed).",
    keys: &[
        key(
            "sides",
            Kind::Axes { dimension: Dimension::LENGTH, range: Range::POSITIVE, uniform: true },
            Absent,
            "Sides of the box.",
        ),
        key(
            "solid_fraction",
            number(Dimension::NONE, Range::between(0.0, 1.0)),
            Absent,
            "Volume of the particles over volume of the box; sizes the box.",
        ),
        key(
            "aspect",
            Kind::Axes { dimension: Dimension::NONE, range: Range::POSITIVE, uniform: false },
            Default::Number(1.0),
            "Proportions of a box that is sized by its solid fraction.",
        ),
        key(
            "boundary",
            Kind::AxisWords(&["periodic", "walls"]),
            Default::Word("periodic"),
            "Periodic, or plane walls at both faces, per axis.",
        ),
        key("wall_material", Kind::AxisWords(&[]), Absent, "Material of the walls; needed for each walled axis."),
    ],
};

const NORMAL_LAW: &str = "Normal force law.";
const TANGENTIAL_LAW: &str = "Tangential force law; without one, contacts are frictionless.";
const ROLLING_LAW: &str = "Rolling and twisting resistance; without one, there is none.";

/// `[contact]`.
pub static CONTACT: Table = Table {
    meaning: "Contact laws of every pair of materials that no [[pair]] changes. A law is a section, \
              [contact.normal.hertz], or its name for all its defaults, normal = \"hertz\".",
    keys: &[
        key("normal", Kind::Law(Role::Normal), Required, NORMAL_LAW),
        key("tangential", Kind::Law(Role::Tangential), Default::Word("none"), TANGENTIAL_LAW),
        key("rolling", Kind::Law(Role::Rolling), Default::Word("none"), ROLLING_LAW),
        key(
            "max_overlap_fraction",
            number(Dimension::NONE, Range::closed(1e-6, 1.0)),
            Default::Number(0.2),
            "A contact whose overlap exceeds this fraction of the smaller radius stops the run.",
        ),
    ],
};

/// `[[pair]]`.
pub static PAIR: Table = Table {
    meaning: "Laws and constants of one pair of materials. Where two materials differ in a constant, \
              it must stand here: nothing is mixed silently.",
    keys: &[
        key("materials", Kind::Texts(2), Required, "Names of the two materials."),
        key("normal", Kind::Law(Role::Normal), Derived("as in [contact]"), NORMAL_LAW),
        key("tangential", Kind::Law(Role::Tangential), Derived("as in [contact]"), TANGENTIAL_LAW),
        key("rolling", Kind::Law(Role::Rolling), Derived("as in [contact]"), ROLLING_LAW),
        key(
            "restitution",
            number(Dimension::NONE, Range::FRACTION),
            Derived("that of the materials, if equal"),
            "Coefficient of restitution.",
        ),
        key("friction", COEFFICIENT, Derived("that of the materials, if equal"), "Coulomb friction coefficient."),
        key(
            "rolling_friction",
            COEFFICIENT,
            Derived("that of the materials, if equal"),
            "Rolling friction coefficient.",
        ),
        key(
            "twisting_friction",
            COEFFICIENT,
            Derived("that of the materials, if equal"),
            "Twisting friction coefficient.",
        ),
        key(
            "surface_energy",
            number(Dimension::SURFACE_ENERGY, Range::NOT_NEGATIVE),
            Derived("that of the materials, if equal"),
            "Work of adhesion between the two surfaces.",
        ),
    ],
};

/// `[packing]`.
pub static PACKING: Table = Table {
    meaning: "How the initial positions are made.",
    keys: &[
        key("random_close", Kind::Table(&RANDOM_CLOSE), Absent, "Jodrey-Tory random close packing."),
        key(
            "relaxation",
            Kind::Table(&RELAXATION),
            Absent,
            "Random packing by relaxation of overlaps, of spheres and ellipsoids.",
        ),
        key("drop_and_roll", Kind::Table(&DROP_AND_ROLL), Absent, "Spheres dropped one after the other."),
        key("file", Kind::Table(&FILE), Absent, "Particles from a file."),
    ],
};

const REPLICATE: Key = key(
    "replicate",
    Kind::Integers3,
    Derived("[1, 1, 1]"),
    "Copies of the packing per axis, side by side; counts, cell and file describe one of them. Each rank makes its \
     own share of the copies, so that large packings come from small ones.",
);
const PERTURBATION: Key = key(
    "perturbation",
    number(Dimension::NONE, Range::closed(0.0, 0.5)),
    ZERO,
    "Every particle is moved at random by at most this fraction of its radius, so that copies differ.",
);

static RELAXATION: Table = Table {
    meaning: "Random packing of spheres and ellipsoids in a periodic cell: random places and orientations are compressed \
              by a pressure that falls step by step, and ends with particles just touching. With a solid fraction \
              below the one where they jam, overlaps are relaxed in a cell of that size instead.",
    keys: &[
        key(
            "tolerance",
            number(Dimension::NONE, Range::closed(1e-4, 0.5)),
            Default::Number(0.03),
            "Residual force over mean contact force at which a pressure counts as balanced; smaller is a little denser \
             and slower.",
        ),
        key("max_steps", Kind::Integer(1), Default::Integer(50_000), "Give up after this many steps at one pressure."),
        REPLICATE,
        PERTURBATION,
    ],
};

static RANDOM_CLOSE: Table = Table {
    meaning: "Jodrey-Tory random close packing of spheres, periodic or between walls; ends with spheres just touching.",
    keys: &[
        key(
            "contraction_rate",
            number(Dimension::NONE, Range::between(0.0, 1.0)),
            Default::Number(5e-4),
            "How fast the outer diameter contracts; smaller is denser and slower.",
        ),
        key(
            "max_moves_per_particle",
            number(Dimension::NONE, Range::POSITIVE),
            Default::Number(1e5),
            "Give up after this many moves per particle.",
        ),
        REPLICATE,
        PERTURBATION,
    ],
};

static DROP_AND_ROLL: Table = Table {
    meaning: "Spheres fall one after the other and roll down to where three others, or the floor, hold them; solid \
              fraction about 0.58. Periodic in x and y. With a periodic z axis, floor and surface are cut off, and the \
              overlaps at the cut relaxed; counts are those of the particles kept (exactly in all, about so per \
              species), and the height follows from the packing, so `cell` takes an `aspect` only. With walls in z the \
              bed stays as it fell on the lower wall, and the upper one touches it unless `sides` are given.",
    keys: &[
        key(
            "margin",
            number(Dimension::NONE, Range::closed(1.0, 100.0)),
            Default::Number(4.0),
            "Height that is cut off at the floor and at the surface, in largest diameters; periodic z axis only.",
        ),
        key(
            "remaining_overlap",
            number(Dimension::NONE, Range::closed(1e-10, 0.1)),
            Default::Number(1e-6),
            "Largest overlap left at the cut, as a fraction of the smaller radius; periodic z axis only.",
        ),
        REPLICATE,
        PERTURBATION,
    ],
};

static FILE: Table = Table {
    meaning: "Particles from a file. For CSV and HDF5 the cell's `sides` must be given; a LAMMPS data file has its own.",
    keys: &[
        key(
            "path",
            Kind::Text,
            Required,
            "CSV, HDF5 or LAMMPS data file, relative to this input. CSV columns: species, x_m, y_m, z_m, radius_m \
         (of ellipsoids a_m, b_m, c_m, qw, qx, qy, qz instead) and optionally vx_m_per_s, vy_m_per_s, vz_m_per_s, wx_rad_per_s, wy_rad_per_s, wz_rad_per_s; lengths and velocities also with mm, um or nm for m. HDF5 \
         (.h5, .hdf5): a one-dimensional dataset per column, with the column's name, in the root group, all of one \
         length; species as strings, the others as floating point; row by row as in CSV. LAMMPS data file \
         (.data, .lmp, or any name if a line `N atoms` is near its beginning): atom_style sphere, SI units, upright \
         box, ids 1 to N in any order; type 1 is the first species, type 2 the second; densities must be those of the \
         materials.",
        ),
        REPLICATE,
        PERTURBATION,
    ],
};

/// `[load]`.
pub static LOAD: Table = Table {
    meaning: "What all stages share.",
    keys: &[
        key(
            "kinematics",
            Kind::Choice(&["BCT", "BC"]),
            Default::Word("BCT"),
            "BCT: particles move with the strain increment; BC: only the cell changes.",
        ),
        key(
            "routine",
            Kind::Choice(&["dynamic", "quasi_static"]),
            Default::Word("dynamic"),
            "dynamic: physical time; quasi_static: equilibria, one strain increment after the other. Stages may differ.",
        ),
        key(
            "quasi_static",
            Kind::Table(&QUASI_STATIC),
            Derived("all its defaults"),
            "How quasi-static stages find their equilibria.",
        ),
        key(
            "control_interval",
            Kind::Integer(1),
            Default::Integer(50),
            "Evaluate what hangs on the whole system (automatic time step, servo, stress ends) every so many steps.",
        ),
    ],
};

/// `[[stage]]`.
pub static STAGE: Table = Table {
    meaning: "A stage of the load programme; it ends at the first of its end conditions that is met. Compression is \
              positive. Dynamic: give `strain_rate`, `stress` (on other axes) or `hold`. Quasi-static: give \
              `strain_increment` or `relax`. Or give `cycles` and [[stage.part]].",
    keys: &[
        key("name", Kind::Text, Derived("stage 1, stage 2, …"), "Name shown in the log."),
        key("cycles", Kind::Integer(1), Absent, "Run the parts of this stage so many times."),
        key("part", Kind::List(&PART), Absent, "What one cycle consists of, in order."),
        PART_KEYS[1],
        PART_KEYS[2],
        PART_KEYS[3],
        PART_KEYS[4],
        PART_KEYS[5],
        PART_KEYS[6],
        PART_KEYS[7],
        PART_KEYS[8],
        PART_KEYS[9],
        PART_KEYS[10],
        PART_KEYS[11],
    ],
};

/// `[[stage.part]]`.
pub static PART: Table =
    Table { meaning: "One part of a cycle; keys as in [[stage]], without `cycles`.", keys: &PART_KEYS };

const PART_KEYS: [Key; 12] = [
    key("name", Kind::Text, Derived("part 1, part 2, …"), "Name shown in the log."),
    key(
        "strain_rate",
        axes(Dimension::RATE, true),
        Absent,
        "Nominal strain rate; one value is isotropic, {z = …} uniaxial.",
    ),
    key("stress", Kind::Table(&STRESS), Absent, "Servo to a stress, per axis."),
    key("hold", Kind::Flag, Absent, "true: the cell stays as it is."),
    key("duration", number(Dimension::TIME, Range::POSITIVE), Absent, "Ends after this time."),
    key(
        "until_strain",
        Kind::Table(&UNTIL_STRAIN),
        Absent,
        "Ends when the strain of the axis, counted from the start of the run, passes this value.",
    ),
    key("until_stress", Kind::Table(&UNTIL_STRESS), Absent, "Ends when the stress of the axis passes this value."),
    key("steps", Kind::Integer(1), Absent, "Ends after so many steps."),
    key("routine", Kind::Choice(&["dynamic", "quasi_static"]), Derived("that of [load]"), "Routine of this stage."),
    key(
        "strain_increment",
        Kind::Axes { dimension: Dimension::NONE, range: Range::between(-0.01, 0.01), uniform: true },
        Absent,
        "Quasi-static: nominal strain from one equilibrium to the next; ends by until_strain, until_stress, increments.",
    ),
    key("increments", Kind::Integer(1), Absent, "Quasi-static: ends after so many increments."),
    key("relax", Kind::Flag, Absent, "true: quasi-static, the cell stays as it is until there is equilibrium."),
];

static STRESS: Table = Table {
    meaning: "Axes under constant stress.",
    keys: &[
        key("x", Kind::Table(&SERVO), Absent, "Servo of the x axis."),
        key("y", Kind::Table(&SERVO), Absent, "Servo of the y axis."),
        key("z", Kind::Table(&SERVO), Absent, "Servo of the z axis."),
    ],
};

static SERVO: Table = Table {
    meaning: "Servo of one axis.",
    keys: &[
        key("target", number(Dimension::PRESSURE, Range::ANY), Required, "Stress to reach and hold."),
        key("max_rate", number(Dimension::RATE, Range::POSITIVE), Required, "Largest strain rate of the servo."),
    ],
};

const STRAIN: Kind =
    number(Dimension::NONE, Range { min: f64::NEG_INFINITY, max: 1.0, min_allowed: false, max_allowed: false });

static UNTIL_STRAIN: Table = Table {
    meaning: "One axis and its strain.",
    keys: &[
        key("x", STRAIN, Absent, "Strain of the x axis."),
        key("y", STRAIN, Absent, "Strain of the y axis."),
        key("z", STRAIN, Absent, "Strain of the z axis."),
    ],
};

static UNTIL_STRESS: Table = Table {
    meaning: "One axis and its stress, passed from the side on which the stage begins; while the cell is only compressed, from below.",
    keys: &[
        key("x", number(Dimension::PRESSURE, Range::ANY), Absent, "Stress of the x axis."),
        key("y", number(Dimension::PRESSURE, Range::ANY), Absent, "Stress of the y axis."),
        key("z", number(Dimension::PRESSURE, Range::ANY), Absent, "Stress of the z axis."),
    ],
};

/// `[time_step]`.
pub static TIME_STEP: Table = Table {
    meaning: "The time step; a plain value is the fixed one. No step strains the cell by more than 1e-5.",
    keys: &[
        key("automatic", Kind::Table(&AUTOMATIC), Absent, "From the stiffest contact, re-evaluated."),
        key("fixed", number(Dimension::TIME, Range::POSITIVE), Absent, "Set by hand."),
    ],
};

static AUTOMATIC: Table = Table {
    meaning: "safety · √(smallest mass / largest contact stiffness).",
    keys: &[
        key(
            "safety",
            number(Dimension::NONE, Range::closed(0.001, 0.5)),
            Default::Number(0.17),
            "Factor β; dashpots of low restitution lower it, as packings would vibrate otherwise.",
        ),
        key(
            "reference_overlap",
            number(Dimension::NONE, Range::between(0.0, 1.0)),
            Default::Number(1e-3),
            "Overlap over radius at which the stiffness is taken at least.",
        ),
    ],
};

/// `[output]`.
pub static OUTPUT: Table = Table {
    meaning: "What is written, and how often.",
    keys: &[
        key("directory", Kind::Text, Derived("runs/<name of the file>"), "The run directory, for one run at a time."),
        key(
            "history",
            Kind::Interval,
            Default::Word("1000 steps"),
            "A row of history.csv every so often; counted in increments, dynamic stages have one every 1000 steps.",
        ),
        key("snapshots", Kind::Interval, Absent, "A snapshot every so often; none without it."),
        key(
            "dump",
            Kind::Flag,
            Default::Flag(false),
            "Write each snapshot also as a LAMMPS text dump, for OVITO: particles-NUMBER.dump.",
        ),
        key("snapshot_contacts", Kind::Flag, Default::Flag(false), "Write contacts with force and memory too."),
        key(
            "checkpoint_steps",
            Kind::Integer(0),
            Default::Integer(100_000),
            "A checkpoint every so many steps; 0: at the end only.",
        ),
        key(
            "checkpoint_wall_time",
            number(Dimension::TIME, Range::POSITIVE),
            Absent,
            "A checkpoint every so much wall time too.",
        ),
        key("checkpoints_kept", Kind::Integer(1), Default::Integer(2), "Older checkpoints are removed."),
        key(
            "energy_ledger",
            Kind::Flag,
            Default::Flag(false),
            "Keep account of work and dissipation by cause; costs some speed. What is held and dissipated less the work stays \
             the same up to an error that falls with the time step: at second order between elastic contacts under constant \
             rates, at first with dashpots, sliding and rates that jump. Not so between ellipsoids, whose force law has no \
             potential. Plastic contacts that begin overlapping count as pressed in before the first row.",
        ),
        key(
            "orientations",
            Kind::Flag,
            Default::Flag(false),
            "Follow the orientations of spheres, for pictures; costs some speed.",
        ),
        key("plots", Kind::Flag, Default::Flag(true), "Draw plots at the end."),
    ],
};

/// `[parallel]`.
pub static PARALLEL: Table = Table {
    meaning: "Ranks, threads, lists. Nothing here changes a result.",
    keys: &[
        key("grid", Kind::Integers3, Absent, "Ranks per axis; chosen by itself if absent."),
        key("threads", Kind::Integer(1), Absent, "Threads per rank, 1024 at most; chosen by itself if absent."),
        key(
            "skin",
            number(Dimension::NONE, Range::between(0.0, 1.0)),
            Default::Number(0.1),
            "Skin of the Verlet list as a fraction of the largest diameter.",
        ),
        key(
            "min_particles_per_rank",
            Kind::Integer(1),
            Default::Integer(1000),
            "The automatic grid gives no rank fewer.",
        ),
        key(
            "simd",
            Kind::Choice(&["auto", "scalar", "avx2", "avx512"]),
            Default::Word("auto"),
            "Vector instructions; `auto` takes the widest that the processor has.",
        ),
    ],
};
