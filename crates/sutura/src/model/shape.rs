//! Shapes that threads and bodies touch: fixed, driven, pushed along a line by a force, or part of a body.

use crate::error::{Error, check};
use crate::math::Pose;
use crate::model::mesh::{self, CheckedMesh};
use glam::DVec3;

/// A shape. Marker of [`Handle`](crate::Handle).
#[derive(Debug)]
pub enum Shape {}

/// A shape to insert.
#[derive(Debug, Clone)]
pub struct ShapeSpec {
    /// Its geometry in its own frame.
    pub geometry: Geometry,
    /// Where it is, `world_from_body`.
    pub pose: Pose,
    /// Surface for friction, an index of the user's choice.
    pub surface: u32,
    /// What moves it.
    pub motion: ShapeMotion,
    /// Whether a mesh that would be closed but for small holes is meant so. It is then a sheet with two sides; else it
    /// is refused.
    pub open: bool,
}

/// Geometry in the body frame, lengths in meters. All but the plane and an open mesh are solid.
#[derive(Debug, Clone, PartialEq)]
pub enum Geometry {
    /// The half space below `z = 0` of the body frame is solid.
    Plane,
    /// A ball about the origin.
    Sphere {
        /// Radius \[m\].
        radius: f64,
    },
    /// Points within `radius` of the piece of the z axis from `-half_length` to `half_length`.
    Capsule {
        /// Radius \[m\].
        radius: f64,
        /// Half the length of the straight part \[m\].
        half_length: f64,
    },
    /// A solid cylinder about the z axis.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Half the length \[m\].
        half_length: f64,
    },
    /// A solid box.
    Box {
        /// Half the side along each axis \[m\].
        half_sides: DVec3,
    },
    /// A triangle mesh, corners counterclockwise as seen from outside. A closed one is solid, or a container where its
    /// normals point inward; of an open one threads stay on the side on which they are when they first come near. What
    /// was mended when it was inserted, and whether it is open, says [`World::shape_notes`](crate::World::shape_notes).
    Mesh {
        /// Corners \[m\].
        vertices: Vec<DVec3>,
        /// Corners of each triangle.
        triangles: Vec<[u32; 3]>,
    },
}

/// What moves a shape.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ShapeMotion {
    /// Nothing, ever.
    Fixed,
    /// The user, through [`World::set_shape_pose`](crate::World::set_shape_pose).
    Driven,
    /// A force along a line, with a speed limit (see [`Drive::Force`](crate::Drive::Force) for the law). It does not
    /// turn.
    Pushed {
        /// Direction of the force in the world, a unit vector.
        direction: DVec3,
        /// Force wanted \[N\], >= 0.
        force: f64,
        /// Speed at which it moves when nothing resists \[m/s\], > 0.
        speed_limit: f64,
    },
    /// The body that it is part of; for shapes that [`World::insert_body`](crate::World::insert_body) makes.
    OnBody,
}

impl ShapeSpec {
    /// A fixed shape.
    pub fn fixed(geometry: Geometry, pose: Pose) -> Self {
        ShapeSpec { geometry, pose, surface: 0, motion: ShapeMotion::Fixed, open: false }
    }

    fn validate(&self) -> Result<(), Error> {
        let what = "shape";
        if !self.pose.is_valid() {
            return Err(Error::invalid(what, "pose", self.pose, "finite, with a unit quaternion"));
        }
        let length = |field: &str, v: f64| check(what, field, v, v > 0.0, "a finite length > 0 [m]");
        match &self.geometry {
            Geometry::Plane => {}
            Geometry::Sphere { radius } => length("radius", *radius)?,
            Geometry::Capsule { radius, half_length } | Geometry::Cylinder { radius, half_length } => {
                length("radius", *radius)?;
                length("half_length", *half_length)?;
            }
            Geometry::Box { half_sides } => {
                length("half_sides.x", half_sides.x)?;
                length("half_sides.y", half_sides.y)?;
                length("half_sides.z", half_sides.z)?;
            }
            // By `check`.
            Geometry::Mesh { .. } => {}
        }
        self.motion.validate()
    }

    /// The geometry checked, of a mesh as it was mended.
    pub(crate) fn check(&self) -> Result<Checked, Error> {
        self.validate()?;
        let Geometry::Mesh { vertices, triangles } = &self.geometry else {
            return Ok(Checked { geometry: self.geometry.clone(), closed: true, container: false, notes: Vec::new() });
        };
        let CheckedMesh { vertices, triangles, closed, container, notes } =
            mesh::check(vertices, triangles, self.open)?;
        Ok(Checked { geometry: Geometry::Mesh { vertices, triangles }, closed, container, notes })
    }
}

/// The geometry of a shape, checked.
pub(crate) struct Checked {
    pub geometry: Geometry,
    /// Whether it has an inside.
    pub closed: bool,
    pub container: bool,
    /// What was mended, and what a user may not have meant.
    pub notes: Vec<String>,
}

impl ShapeMotion {
    pub(crate) fn validate(&self) -> Result<(), Error> {
        if let ShapeMotion::Pushed { direction, force, speed_limit } = self {
            check("shape", "motion.force", *force, *force >= 0.0, "a finite force >= 0 [N]")?;
            check("shape", "motion.speed_limit", *speed_limit, *speed_limit > 0.0, "a finite speed > 0 [m/s]")?;
            if !direction.is_finite() || (direction.length() - 1.0).abs() > 1e-6 {
                return Err(Error::invalid("shape", "motion.direction", direction, "a unit vector"));
            }
        }
        Ok(())
    }
}
