//! Rigid bodies: solids that move together, with the mass that their density gives them.

use crate::error::{Error, check};
use crate::math::{Pose, outer};
use crate::model::collider::Collider;
use crate::model::shape::{Checked, Geometry, ShapeMotion, ShapeSpec};
use glam::{DMat3, DQuat, DVec3};

/// A rigid body. Marker of [`Handle`](crate::Handle).
#[derive(Debug)]
pub enum Body {}

/// A free rigid body to insert: gravity and contact move it.
#[derive(Debug, Clone)]
pub struct BodySpec {
    /// Where its frame is, `world_from_body`.
    pub pose: Pose,
    /// What it consists of, at least one solid.
    pub colliders: Vec<ColliderSpec>,
    /// Velocity of its center of mass \[m/s\].
    pub velocity: DVec3,
    /// Angular velocity in world axes \[rad/s\].
    pub angular_velocity: DVec3,
}

/// What moves a body.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum BodyMotion {
    /// Gravity, contact, and what is attached to it.
    Free,
    /// It goes where it is told ([`World::set_body_pose`](crate::World::set_body_pose)), whatever that takes.
    Driven,
    /// Another body holds it, rigidly: both are one, with the mass of both.
    Held {
        /// The one that holds it, which is free or driven.
        by: crate::Handle<Body>,
    },
}

/// A solid that is part of a body. Where two of one body overlap both have mass.
#[derive(Debug, Clone)]
pub struct ColliderSpec {
    /// Its geometry in its own frame: anything solid, that is no plane, no open mesh and no container.
    pub geometry: Geometry,
    /// Where it is in the body, `body_from_collider`.
    pub pose: Pose,
    /// Density \[kg/m^3\], >= 0; of all of them together at least one has mass.
    pub density: f64,
    /// Surface for friction, an index of the user's choice.
    pub surface: u32,
}

/// Mass, center of mass and moments of inertia of a body in its own frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassProperties {
    /// Mass \[kg\].
    pub mass: f64,
    /// Center of mass \[m\].
    pub center: DVec3,
    /// Principal moments of inertia about the center of mass \[kg m^2\].
    pub moments: DVec3,
    /// Principal axes, `body_from_principal`.
    pub axes: DQuat,
}

/// A body in the world.
pub(crate) struct BodyModel {
    pub mass: MassProperties,
    /// Its shapes, and where each is in the frame of its center of mass and principal axes.
    pub shapes: Vec<(u32, Pose)>,
}

impl BodyModel {
    /// Its radius of gyration about the axis of its largest moment of inertia \[m\].
    pub fn size(&self) -> f64 {
        (self.mass.moments.max_element() / self.mass.mass).sqrt()
    }
}

impl BodySpec {
    /// At rest, of one solid.
    pub fn solid(geometry: Geometry, density: f64, pose: Pose) -> Self {
        let collider = ColliderSpec { geometry, pose: Pose::IDENTITY, density, surface: 0 };
        BodySpec { pose, colliders: vec![collider], velocity: DVec3::ZERO, angular_velocity: DVec3::ZERO }
    }

    /// Its mass properties, from those of its solids.
    pub fn mass_properties(&self) -> Result<MassProperties, Error> {
        self.check().map(|(mass, _)| mass)
    }

    /// Its mass properties and the geometries of its solids, checked.
    pub(crate) fn check(&self) -> Result<(MassProperties, Vec<Checked>), Error> {
        let what = "body";
        if !self.pose.is_valid() {
            return Err(Error::invalid(what, "pose", self.pose, "finite, with a unit quaternion"));
        }
        for (field, v) in [("velocity", self.velocity), ("angular_velocity", self.angular_velocity)] {
            if !v.is_finite() {
                return Err(Error::invalid(what, field, v, "a finite vector"));
            }
        }
        if self.colliders.is_empty() {
            return Err(Error::invalid(what, "colliders", "none", "at least one solid"));
        }
        let mut checked = Vec::new();
        // Sums of mass, first and second moments about the origin of the body.
        let (mut mass, mut first, mut second) = (0.0, DVec3::ZERO, DMat3::ZERO);
        for collider in &self.colliders {
            let solid = collider.check()?;
            let (m, center, inertia) = match &solid.geometry {
                Geometry::Mesh { vertices, triangles } => of_mesh(vertices, triangles, collider.density),
                geometry => Collider::new(geometry)?.mass_properties(collider.density),
            };
            let turn = DMat3::from_quat(collider.pose.orientation);
            let center = collider.pose.transform_point(center);
            mass += m;
            first += center * m;
            second += turn * inertia * turn.transpose() + about(center) * m;
            checked.push(solid);
        }
        check(what, "density", mass, mass > 0.0, "densities that give it a mass > 0 [kg]")?;
        let center = first / mass;
        let (moments, axes) = principal(second - about(center) * mass);
        if !(moments.is_finite() && moments.min_element() > 0.0) {
            return Err(Error::invalid(what, "inertia", moments, "moments of inertia > 0 [kg m^2]"));
        }
        Ok((MassProperties { mass, center, moments, axes }, checked))
    }
}

impl ColliderSpec {
    fn check(&self) -> Result<Checked, Error> {
        let what = "collider";
        if !self.pose.is_valid() {
            return Err(Error::invalid(what, "pose", self.pose, "finite, with a unit quaternion"));
        }
        check(what, "density", self.density, self.density >= 0.0, "a finite density >= 0 [kg/m^3]")?;
        let shape = ShapeSpec {
            geometry: self.geometry.clone(),
            pose: Pose::IDENTITY,
            surface: self.surface,
            motion: ShapeMotion::OnBody,
            open: false,
        };
        let checked = shape.check()?;
        if matches!(checked.geometry, Geometry::Plane) || !checked.closed || checked.container {
            return Err(Error::invalid(what, "geometry", "an open surface", "a solid"));
        }
        Ok(checked)
    }
}

/// Moments of inertia of a unit of mass at a place, about the origin.
fn about(place: DVec3) -> DMat3 {
    DMat3::IDENTITY * place.length_squared() - outer(place, place)
}

/// Mass, center of mass and inertia about it of what a closed mesh bounds: the sum over the tetrahedra between its
/// triangles and the origin, negative where a triangle faces it. (parry3d's turns the axes of a tilted mesh.)
fn of_mesh(vertices: &[DVec3], triangles: &[[u32; 3]], density: f64) -> (f64, DVec3, DMat3) {
    let (mut volume, mut first, mut second) = (0.0, DVec3::ZERO, DMat3::ZERO);
    for triangle in triangles {
        let [a, b, c] = triangle.map(|k| vertices[k as usize]);
        let six = a.dot(b.cross(c));
        let sum = a + b + c;
        volume += six / 6.0;
        first += sum * (six / 24.0);
        second += (outer(sum, sum) + outer(a, a) + outer(b, b) + outer(c, c)) * (six / 120.0);
    }
    let (mass, center) = (volume * density, first / volume);
    let trace = second.col(0).x + second.col(1).y + second.col(2).z;
    let inertia = (DMat3::IDENTITY * trace - second) * density;
    (mass, center, inertia - about(center) * mass)
}

/// Eigenvalues and axes of a symmetric matrix (Jacobi rotations).
fn principal(mut m: DMat3) -> (DVec3, DQuat) {
    let mut axes = DMat3::IDENTITY;
    for _ in 0..50 {
        let off = [(0, 1), (0, 2), (1, 2)];
        let largest = off.into_iter().max_by(|a, b| m.col(a.0)[a.1].abs().total_cmp(&m.col(b.0)[b.1].abs()));
        let Some((i, j)) =
            largest.filter(|(i, j)| m.col(*i)[*j].abs() > 1e-16 * m.col(*i)[*i].abs().max(m.col(*j)[*j].abs()))
        else {
            break;
        };
        let angle = 0.5 * libm::atan2(2.0 * m.col(i)[j], m.col(j)[j] - m.col(i)[i]);
        let (s, c) = (libm::sin(angle), libm::cos(angle));
        let mut turn = DMat3::IDENTITY;
        turn.col_mut(i)[i] = c;
        turn.col_mut(j)[j] = c;
        turn.col_mut(j)[i] = s;
        turn.col_mut(i)[j] = -s;
        m = turn.transpose() * m * turn;
        axes *= turn;
    }
    let moments = DVec3::new(m.col(0).x, m.col(1).y, m.col(2).z);
    (moments, DQuat::from_mat3(&axes).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: f64, b: f64) {
        assert!((a / b - 1.0).abs() < 1e-12, "{a:e} {b:e}");
    }

    #[test]
    fn solids_have_the_inertia_of_the_textbook() {
        let of = |g| BodySpec::solid(g, 1000.0, Pose::IDENTITY).mass_properties().unwrap();
        let ball = of(Geometry::Sphere { radius: 0.02 });
        let m = 4.0 / 3.0 * core::f64::consts::PI * 8e-6 * 1000.0;
        near(ball.mass, m);
        near(ball.moments.x, 0.4 * m * 4e-4);
        let rod = of(Geometry::Cylinder { radius: 0.01, half_length: 0.03 });
        let m = core::f64::consts::PI * 1e-4 * 0.06 * 1000.0;
        near(rod.mass, m);
        // About its axis, which is z.
        let along = rod.axes.inverse() * DVec3::Z;
        near((along * along).dot(rod.moments), 0.5 * m * 1e-4);
        let across = rod.axes.inverse() * DVec3::X;
        near((across * across).dot(rod.moments), m * (3.0 * 1e-4 + 0.06 * 0.06) / 12.0);
        let brick = of(Geometry::Box { half_sides: DVec3::new(0.01, 0.02, 0.03) });
        let along = |axis: DVec3| {
            let a = brick.axes.inverse() * axis;
            (a * a).dot(brick.moments)
        };
        near(along(DVec3::X), brick.mass / 3.0 * (4e-4 + 9e-4));
        near(along(DVec3::Z), brick.mass / 3.0 * (1e-4 + 4e-4));
    }

    /// A box as a mesh, and two boxes beside each other, tilted, are the box that they fill.
    #[test]
    fn a_tilted_mesh_and_an_off_center_compound_are_the_solid_that_they_fill() {
        let half = DVec3::new(0.01, 0.02, 0.03);
        let whole =
            BodySpec::solid(Geometry::Box { half_sides: half }, 800.0, Pose::IDENTITY).mass_properties().unwrap();
        let tilt = Pose::new(DVec3::new(0.3, -0.2, 0.1), DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(0.4));
        let corner = |k: u32| {
            let sign = |bit: u32| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
            tilt.transform_point(DVec3::new(sign(0), sign(1), sign(2)) * half)
        };
        let triangles = vec![
            [0, 3, 1],
            [0, 2, 3],
            [4, 7, 6],
            [4, 5, 7],
            [0, 5, 4],
            [0, 1, 5],
            [2, 7, 3],
            [2, 6, 7],
            [0, 6, 2],
            [0, 4, 6],
            [1, 7, 5],
            [1, 3, 7],
        ];
        let mesh = Geometry::Mesh { vertices: (0..8).map(corner).collect(), triangles };
        let mesh = BodySpec::solid(mesh, 800.0, Pose::IDENTITY).mass_properties().unwrap();
        let quarter = DVec3::new(0.01, 0.02, 0.01);
        let part = |z: f64, half_sides: DVec3| ColliderSpec {
            geometry: Geometry::Box { half_sides },
            pose: tilt.compose(&Pose::at(DVec3::Z * z)),
            density: 800.0,
            surface: 0,
        };
        let compound = BodySpec {
            colliders: vec![part(-0.02, quarter), part(0.01, DVec3::new(0.01, 0.02, 0.02))],
            ..BodySpec::solid(Geometry::Sphere { radius: 1.0 }, 1.0, Pose::IDENTITY)
        };
        let compound = compound.mass_properties().unwrap();
        let inertia = |p: &MassProperties| {
            let axes = DMat3::from_quat(p.axes);
            axes * DMat3::from_diagonal(p.moments) * axes.transpose()
        };
        let turn = DMat3::from_quat(tilt.orientation);
        let wanted = turn * inertia(&whole) * turn.transpose();
        for p in [mesh, compound] {
            near(p.mass, whole.mass);
            assert!((p.center - tilt.position).length() < 1e-12, "{}", p.center);
            let off = inertia(&p) - wanted;
            assert!(off.to_cols_array().iter().all(|v| v.abs() < 1e-12 * whole.moments.max_element()), "{off}");
        }
    }

    #[test]
    fn what_is_open_or_has_no_mass_is_no_body() {
        let of = |g, density| BodySpec::solid(g, density, Pose::IDENTITY).mass_properties();
        assert!(of(Geometry::Plane, 1000.0).is_err());
        assert!(of(Geometry::Sphere { radius: 0.01 }, 0.0).is_err());
        let triangle = Geometry::Mesh { vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y], triangles: vec![[0, 1, 2]] };
        assert!(of(triangle, 1000.0).is_err());
    }
}
