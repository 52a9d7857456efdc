//! The same scene otherwise: turned, mirrored, numbered from the other end, larger or smaller.

use sutura::glam::{DQuat, DVec3};
use sutura::math::exp;
use sutura::{
    Along, Closure, Drive, Geometry, LoadKind, Material, Place, Pose, Profile, ReelLaw, RestShape, RodSpec, Section,
    Settings, ShapeMotion, ShapeSpec,
};

use crate::scene::{Held, Joined, Reeled, Scene, elements};

/// What is done to a scene. The acts of a scene are not transformed: it must have none.
#[derive(Debug, Clone, Copy)]
pub struct Way {
    /// Turned by this, after the reflection.
    pub turn: DQuat,
    /// Reflected at y = 0.
    pub mirror: bool,
    /// Particles numbered from the other end.
    pub reversed: bool,
    /// Lengths and times times this, stresses and densities as they are: forces grow by its square, torques by its
    /// cube, gravity falls by it.
    pub scale: f64,
}

impl Default for Way {
    fn default() -> Self {
        Way { turn: DQuat::IDENTITY, mirror: false, reversed: false, scale: 1.0 }
    }
}

fn reflect(v: DVec3) -> DVec3 {
    DVec3::new(v.x, -v.y, v.z)
}

impl Way {
    fn direction(&self, v: DVec3) -> DVec3 {
        self.turn * if self.mirror { reflect(v) } else { v }
    }
    /// Reflected, a rotation vector or torque changes sign as well.
    fn axial(&self, v: DVec3) -> DVec3 {
        self.turn * if self.mirror { -reflect(v) } else { v }
    }
    fn orientation(&self, q: DQuat) -> DQuat {
        let q = if self.mirror { DQuat::from_xyzw(-q.x, q.y, -q.z, q.w) } else { q };
        if self.turn == DQuat::IDENTITY { q } else { (self.turn * q).normalize() }
    }
    fn point(&self, p: DVec3) -> DVec3 {
        self.direction(p) * self.scale
    }
    /// A point of the transformed scene in the plain one.
    pub fn point_back(&self, p: DVec3) -> DVec3 {
        let v = self.turn.conjugate() * (p / self.scale);
        if self.mirror { reflect(v) } else { v }
    }
    fn pose(&self, pose: Pose) -> Pose {
        Pose::new(self.point(pose.position), self.orientation(pose.orientation))
    }
    /// Rest bend and twist of a joint along the directors \[1/m\].
    fn darboux(&self, k: DVec3) -> DVec3 {
        let k = if self.mirror { DVec3::new(-k.x, k.y, -k.z) } else { k };
        if self.reversed { DVec3::new(-k.x, k.y, k.z) / self.scale } else { k / self.scale }
    }
    fn place(&self, place: Place, n: u32) -> Place {
        match place {
            _ if !self.reversed => place,
            Place::Start => Place::End,
            Place::End => Place::Start,
            Place::Particle(i) => Place::Particle(n - i),
            Place::Element(e) => Place::Element(n - 1 - e),
            Place::Arc(_) => place,
        }
    }
    /// A part lost in a second, of a second that is longer.
    fn damping(&self, d: f64) -> f64 {
        if d == 0.0 { 0.0 } else { 1.0 - libm::pow(1.0 - d, 1.0 / self.scale) }
    }

    fn rod(&self, rod: &RodSpec) -> RodSpec {
        let s = self.scale;
        let mut centerline: Vec<DVec3> = rod.centerline.iter().map(|p| self.point(*p)).collect();
        let mut frames = rod.frames.clone().map(|f| f.into_iter().map(|q| self.orientation(q)).collect::<Vec<_>>());
        let (mut roll, mut pretwist) = (rod.roll, rod.pretwist);
        let mut closure = rod.closure;
        if self.mirror {
            (roll, pretwist) = (-roll, -pretwist);
            closure = closure.map(|c| Closure { twist: -c.twist });
        }
        let mut rest = match &rod.rest {
            RestShape::Given { lengths, darboux } => RestShape::Given {
                lengths: lengths.as_ref().map(|l| l.iter().map(|l| l * s).collect()),
                darboux: darboux.as_ref().map(|d| d.iter().map(|k| self.darboux(*k)).collect()),
            },
            other => other.clone(),
        };
        let length: f64 = match &rest {
            RestShape::Given { lengths: Some(l), .. } => l.iter().sum(),
            _ => crate::scene::length(rod, &centerline),
        };
        let profile = |p: &Profile| {
            let mut points: Vec<(f64, f64)> =
                p.0.iter().map(|(arc, v)| if self.reversed { (length - arc * s, *v) } else { (arc * s, *v) }).collect();
            if self.reversed {
                points.reverse();
            }
            Profile(points)
        };
        let along = Along {
            size: profile(&rod.along.size),
            modulus: profile(&rod.along.modulus),
            density: profile(&rod.along.density),
        };
        if self.reversed {
            centerline.reverse();
            // A seam stays where it is.
            if closure.is_some() {
                centerline.rotate_right(1);
            }
            // Twist put in before closing is counted from the start, where its frames now have what was at their end.
            let turn = closure.map_or(DQuat::IDENTITY, |c| exp(DVec3::Z * -c.twist));
            if let Some(frames) = &mut frames {
                frames.reverse();
                for q in frames {
                    *q *= DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0) * turn;
                }
            }
            (roll, pretwist) = (-(roll + pretwist), pretwist);
            if let RestShape::Given { lengths, darboux } = &mut rest {
                lengths.iter_mut().for_each(|l| l.reverse());
                // The joint at the seam is the last one also from the other end.
                darboux.iter_mut().for_each(|d| {
                    let joints = d.len() - usize::from(closure.is_some());
                    d[..joints].reverse();
                });
            }
        }
        let plasticity = rod.material.plasticity.map(|p| sutura::Plasticity {
            yield_curvature: p.yield_curvature / s,
            yield_twist: p.yield_twist / s,
            ..p
        });
        let material = Material { bend_damping: rod.material.bend_damping * s, plasticity, ..rod.material.clone() };
        let section = match rod.section {
            Section::Round => Section::Round,
            other => other.scaled(s),
        };
        RodSpec {
            centerline,
            frames,
            rest,
            radius: rod.radius * s,
            section,
            roll,
            pretwist,
            along,
            material,
            closure,
            stretch: rod.stretch,
            surface: rod.surface,
        }
    }

    fn shape(&self, shape: &ShapeSpec) -> ShapeSpec {
        let s = self.scale;
        let geometry = match &shape.geometry {
            Geometry::Plane => Geometry::Plane,
            Geometry::Sphere { radius } => Geometry::Sphere { radius: radius * s },
            Geometry::Capsule { radius, half_length } => {
                Geometry::Capsule { radius: radius * s, half_length: half_length * s }
            }
            Geometry::Cylinder { radius, half_length } => {
                Geometry::Cylinder { radius: radius * s, half_length: half_length * s }
            }
            Geometry::Box { half_sides } => Geometry::Box { half_sides: *half_sides * s },
            Geometry::Mesh { vertices, triangles } => Geometry::Mesh {
                vertices: vertices.iter().map(|v| if self.mirror { reflect(*v) } else { *v } * s).collect(),
                triangles: triangles.iter().map(|t| if self.mirror { [t[0], t[2], t[1]] } else { *t }).collect(),
            },
        };
        let motion = match shape.motion {
            ShapeMotion::Pushed { direction, force, speed_limit } => {
                ShapeMotion::Pushed { direction: self.direction(direction), force: force * s * s, speed_limit }
            }
            other => other,
        };
        ShapeSpec { geometry, pose: self.pose(shape.pose), surface: shape.surface, motion, open: shape.open }
    }

    fn load(&self, kind: &LoadKind, n: u32) -> LoadKind {
        let s = self.scale;
        match *kind {
            LoadKind::Point { place, force, torque } => LoadKind::Point {
                place: self.place(place, n),
                force: self.direction(force) * (s * s),
                torque: self.axial(torque) * (s * s * s),
            },
            LoadKind::Uniform { force_per_length } => {
                LoadKind::Uniform { force_per_length: self.direction(force_per_length) * s }
            }
            LoadKind::Mass { place, mass, inertia } => LoadKind::Mass {
                place: self.place(place, n),
                mass: mass * (s * s * s),
                inertia: inertia * (s * s * s * s * s),
            },
        }
    }

    fn grip(&self, grip: &Held, n: u32) -> Held {
        let s = self.scale;
        let drive = match grip.drive {
            Drive::Force { direction, force, speed_limit } => {
                Drive::Force { direction: self.direction(direction), force: force * s * s, speed_limit }
            }
            Drive::Hand { direction, force, speed_limit } => {
                Drive::Hand { direction: self.direction(direction), force: force * s * s, speed_limit }
            }
            Drive::Pose => Drive::Pose,
            other => panic!("{other:?} is not turned and scaled"),
        };
        Held {
            place: self.place(grip.place, n),
            drive,
            ramp: grip.ramp * s,
            velocity: self.direction(grip.velocity),
            spin: self.axial(grip.spin) / s,
            ..grip.clone()
        }
    }

    fn law(&self, law: ReelLaw) -> ReelLaw {
        match law {
            ReelLaw::Rate(rate) => ReelLaw::Rate(rate),
            ReelLaw::Brake(force) => ReelLaw::Brake(force * self.scale * self.scale),
        }
    }

    fn reel(&self, reel: &Reeled) -> Reeled {
        let later = reel.later.map(|(frame, law)| (frame, self.law(law)));
        Reeled { at_end: reel.at_end != self.reversed, law: self.law(reel.law), later, ..*reel }
    }

    /// The settings that go with it.
    pub fn settings(&self, settings: &Settings) -> Settings {
        Settings {
            gravity: self.direction(settings.gravity) / self.scale,
            substep: settings.substep * self.scale,
            linear_damping: self.damping(settings.linear_damping),
            angular_damping: self.damping(settings.angular_damping),
            linear_drag: settings.linear_drag / self.scale,
            angular_drag: settings.angular_drag / self.scale,
            ..settings.clone()
        }
    }

    /// The scene done this way.
    pub fn scene(&self, scene: &Scene) -> Scene {
        assert!(scene.acts.is_empty(), "acts are not transformed");
        let n = |rod: usize| elements(&scene.rods[rod]);
        let weld = |w: &Joined| Joined {
            places: w.places.iter().map(|(rod, place)| (*rod, self.place(*place, n(*rod)))).collect(),
            ..w.clone()
        };
        Scene {
            settings: self.settings(&scene.settings),
            rods: scene.rods.iter().map(|r| self.rod(r)).collect(),
            welds: scene.welds.iter().map(weld).collect(),
            reels: scene.reels.iter().map(|r| self.reel(r)).collect(),
            shapes: scene.shapes.iter().map(|s| self.shape(s)).collect(),
            grips: scene.grips.iter().map(|g| self.grip(g, n(g.rod))).collect(),
            loads: scene.loads.iter().map(|(rod, kind)| (*rod, self.load(kind, n(*rod)))).collect(),
            frame: scene.frame * self.scale,
            ..scene.clone()
        }
    }

    /// Positions of the transformed scene's thread in the plain one, numbered as there.
    pub fn positions_back(&self, positions: &[DVec3]) -> Vec<DVec3> {
        let mut back: Vec<DVec3> = positions.iter().map(|p| self.point_back(*p)).collect();
        if self.reversed {
            back.reverse();
        }
        back
    }
}
