//! A loose knot around a post in two halves, drawn tight by its tails and let go; the halves of the post then load its
//! loop. What the studies of knots that hold have in common.

use crate::case::Budget;
use crate::curve::{Stack, knot_free};
use crate::session::Session;
use sutura::glam::DVec3;
use sutura::knot::{Entries, Form, entries, form};
use sutura::{
    Drive, Friction, Geometry, GripSpec, Handle, Hold, Material, Place, Pose, Rod, RodSpec, RodView, Settings, Shape,
    ShapeMotion, ShapeSpec, World,
};

/// What is tied.
#[derive(Debug, Clone, PartialEq)]
pub struct Spec {
    /// Material of the thread.
    pub material: Material,
    /// Thread, throws, post and tails.
    pub stack: Stack,
    /// Friction of thread on thread.
    pub mu: f64,
    /// Element length in diameters.
    pub element: f64,
    /// Longest substep \[s\].
    pub substep: f64,
}

/// Friction of thread on the post, as the scene square_knot.
const MU_POST: f64 = 0.15;
/// Half the length of the post, in radii of it.
const POST_HALF_LENGTH: f64 = 10.0;
/// Speed at which a tail is drawn when nothing resists \[m/s\].
const DRAW_SPEED: f64 = 0.03;
/// Force on the halves of the post that keeps the loop taut while the tails are drawn, and to which it rises when they
/// are, so that the first throws get tight too; over the force on the tails.
const COUNTER: (f64, f64) = (0.25, 1.0);
/// Speed at which a half of the post is pushed meanwhile when nothing resists \[m/s\].
const PUSH_SPEED: f64 = 0.005;
/// A tail counts as drawn at this part of the force: it rests only in the limit. The scene has the same.
const DRAWN: f64 = 0.975;
/// The longest that a draw may take, and how long the phases after it are \[s\].
const DRAW_LONGEST: f64 = 3.0;
const TIGHTEN: f64 = 0.3;
const DRAW_SETTLE: f64 = 0.2;
const LET_GO: f64 = 0.3;
/// Length of a frame \[s\].
pub const FRAME: f64 = 1.0 / 60.0;
/// Surfaces.
const THREAD_SURFACE: u32 = 0;
const POST_SURFACE: u32 = 1;

/// A knot around its post, on the way from loose to tight.
pub struct Tied<'a> {
    /// World, audit and budget.
    pub s: Session,
    rod: Handle<Rod>,
    /// Left and right half.
    posts: [Handle<Shape>; 2],
    /// Force that both tails reached \[N\].
    pub drawn: f64,
    trace: &'a mut dyn FnMut(String),
}

impl<'a> Tied<'a> {
    /// The loose knot. `trace` takes lines that say how it goes.
    pub fn new(spec: &Spec, budget: Budget, trace: &'a mut dyn FnMut(String)) -> Result<Self, String> {
        let text = |e: sutura::Error| e.to_string();
        let settings = Settings {
            gravity: DVec3::ZERO,
            substep: spec.substep,
            linear_damping: 0.9,
            angular_damping: 0.9,
            ..Settings::default()
        };
        let mut world = World::new(settings).map_err(text)?;
        world.set_friction(THREAD_SURFACE, THREAD_SURFACE, Friction::coulomb(spec.mu)).map_err(text)?;
        world.set_friction(THREAD_SURFACE, POST_SURFACE, Friction::coulomb(MU_POST)).map_err(text)?;
        let Stack { diameter, post: radius, .. } = spec.stack;
        let thread =
            RodSpec::new(spec.stack.centerline(spec.element * diameter), 0.5 * diameter, spec.material.clone());
        let rod = world.insert_rod(&RodSpec { surface: THREAD_SURFACE, ..thread }).map_err(text)?;
        let post = ShapeSpec::fixed(
            Geometry::Cylinder { radius, half_length: POST_HALF_LENGTH * radius },
            Pose::at(DVec3::ZERO),
        );
        let post = ShapeSpec { surface: POST_SURFACE, ..post };
        let posts = [world.insert_shape(&post).map_err(text)?, world.insert_shape(&post).map_err(text)?];
        Ok(Tied { s: Session::new(world, budget), rod, posts, drawn: 0.0, trace })
    }

    /// The thread.
    pub fn rod(&self) -> Result<RodView<'_>, String> {
        self.s.world.rod(self.rod).map_err(|e| e.to_string())
    }

    /// Name of its knot, with free ends.
    pub fn knot(&self) -> Result<String, String> {
        Ok(knot_free(self.rod()?.positions()).name().to_string())
    }

    /// Where it enters its knot.
    pub fn entries(&self) -> Option<Entries> {
        let rod = self.rod().ok()?;
        entries(rod.positions(), rod.rest_lengths(), rod.radius())
    }

    /// How its knot lies.
    pub fn form(&self) -> Option<Form> {
        let rod = self.rod().ok()?;
        form(rod.positions(), rod.rest_lengths(), rod.radius())
    }

    /// Mean tension of the loop, between the inner entries of the knot \[N\].
    pub fn loop_tension(&self) -> Option<f64> {
        let [from, to] = self.entries()?.loop_ab?;
        self.rod().ok()?.mean_tension(from, to)
    }

    /// Outward force of the loop on the halves of the post: the lesser of the two \[N\].
    pub fn load(&self) -> f64 {
        let along = |k: usize, sign: f64| self.s.world.shape_wrench(self.posts[k]).map_or(0.0, |w| sign * w.force.x);
        along(0, 1.0).min(along(1, -1.0))
    }

    /// Length of thread in the loop, less a constant: twice the distance of the halves \[m\].
    pub fn opened(&self) -> f64 {
        let x = |k: usize| self.s.world.shape(self.posts[k]).map_or(0.0, |s| s.pose.position.x);
        2.0 * (x(1) - x(0))
    }

    /// Pushes the halves of the post apart, each with this force \[N\] and speed limit \[m/s\].
    pub fn push(&mut self, force: f64, speed_limit: f64) -> Result<(), String> {
        for (post, x) in self.posts.into_iter().zip([-1.0, 1.0]) {
            let motion = ShapeMotion::Pushed { direction: DVec3::X * x, force, speed_limit };
            self.s.world.set_shape_motion(post, motion).map_err(|e| e.to_string())?;
        }
        Ok(())
    }

    /// Says where it stands.
    pub fn say(&mut self, what: &str) {
        let s = &self.s;
        let line = format!(
            "{:.3} s: {what}, load {:.3} N, loop {:.3} mm longer, {} contacts, {} substeps, {} rejected, {:.0} ms a frame so far",
            s.world.time(),
            self.load(),
            1e3 * self.opened(),
            s.world.contacts().count(),
            s.substeps,
            s.rejected,
            1e3 * s.solver_s() / s.ms.len().max(1) as f64
        );
        (self.trace)(line);
    }

    /// Says anything else.
    pub fn tell(&mut self, line: String) {
        (self.trace)(line);
    }

    /// One frame; now and then says how it goes.
    pub fn frame(&mut self, what: &str) -> Result<(), String> {
        self.s.frame(FRAME)?;
        if self.s.ms.len().is_multiple_of(20) {
            self.say(what);
        }
        Ok(())
    }

    /// Draws the tails apart by force, tightens the loop against them, and lets the tails go, with the halves of the
    /// post fixed. What the knot was when drawn.
    pub fn draw(&mut self, force: f64) -> Result<String, String> {
        let text = |e: sutura::Error| e.to_string();
        let x = self.rod()?.positions();
        let outward = [x[0] - x[1], x[x.len() - 1] - x[x.len() - 2]].map(|v| DVec3::X * v.x.signum());
        let mut grips = Vec::new();
        for (place, direction) in [Place::Start, Place::End].into_iter().zip(outward) {
            let drive = Drive::Force { direction, force, speed_limit: DRAW_SPEED };
            grips.push(
                self.s
                    .world
                    .insert_grip(&GripSpec { drive, ..GripSpec::at_once(self.rod, place, Hold::Pin) })
                    .map_err(text)?,
            );
        }
        self.push(COUNTER.0 * force, PUSH_SPEED)?;
        let pull = |s: &Session, k: usize| s.world.grip_wrench(grips[k]).map(|w| w.force.dot(outward[k])).map_err(text);
        while self.drawn < DRAWN * force {
            if self.s.world.time() > DRAW_LONGEST {
                return Err(format!("the tails were not drawn to the force in {DRAW_LONGEST} s"));
            }
            self.frame("drawing")?;
            self.drawn = pull(&self.s, 0)?.min(pull(&self.s, 1)?);
        }
        for k in 1..=((TIGHTEN + DRAW_SETTLE) / FRAME).round() as u32 {
            let part = (f64::from(k) * FRAME / TIGHTEN).min(1.0);
            self.push((COUNTER.0 + (COUNTER.1 - COUNTER.0) * part) * force, PUSH_SPEED)?;
            self.frame("tightening")?;
        }
        let knot = self.knot()?;
        for grip in grips {
            self.s.world.remove_grip(grip).map_err(text)?;
        }
        for post in self.posts {
            self.s.world.set_shape_motion(post, ShapeMotion::Fixed).map_err(text)?;
        }
        self.say("let go");
        Ok(knot)
    }

    /// Lets the knot come to rest after the draw.
    pub fn rest(&mut self) -> Result<(), String> {
        for _ in 0..(LET_GO / FRAME).round() as u32 {
            self.frame("let go")?;
        }
        Ok(())
    }
}
