//! Frames of physics in real time.

use crate::world::Sutura;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;
use std::time::{Duration, Instant};

/// Runs once for each frame of physics.
#[derive(ScheduleLabel, Debug, Clone, PartialEq, Eq, Hash)]
pub struct PhysicsFrame;

/// The order of a frame of physics.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub enum PhysicsSet {
    /// Systems that act on the world or set targets of grips and bodies.
    Drive,
    /// The step of the engine.
    Step,
}

/// All frames of physics of a drawn frame, and what is drawn of them, in `RunFixedMainLoop`. What runs after it in that
/// schedule sees the new state before `Update`.
#[derive(SystemSet, Debug, Clone, PartialEq, Eq, Hash)]
pub struct PhysicsLoop;

/// How physics follows real time.
#[derive(Resource, Debug, Clone)]
pub struct PhysicsClock {
    /// Whether it goes on.
    pub running: bool,
    /// Simulated over real time that is wanted, >= 0.
    pub speed: f64,
    /// Length of a frame of physics \[s\], > 0.
    pub frame: f64,
    /// Frames to do although it does not run; counts down.
    pub by_hand: u32,
    /// Most time of a drawn frame that physics may take. At least one frame is done where one is due.
    pub budget: Duration,
    /// Where all the rest of a drawn frame takes longer than `budget`, physics may take as long, but not longer than
    /// this: so slow pictures slow no physics.
    pub share: Duration,
    /// Most time that a frame of physics may take, where it may not take as long as it needs. One that needs longer
    /// ends early, at a state as good as any: slow motion, but no picture that waits. What it does then depends on how
    /// fast the machine is; a recording of the input plays it back as it was.
    pub most_frame: Option<Duration>,
    /// Most simulated time that may be owed \[s\]. What exceeds it is given up, so that physics which is too slow runs
    /// slowly instead of running after a debt that only grows.
    pub most_owed: f64,
    /// Simulated time that is owed \[s\].
    pub owed: f64,
    /// Simulated time given up so far \[s\].
    pub lost: f64,
    /// Frames of physics done so far.
    pub frames: u64,
    /// Frames done in this drawn frame.
    pub now: u32,
    /// Of those still to be done in this drawn frame, this one among them.
    pub remaining: u32,
    /// Time that the last frame of physics took \[ms\].
    pub ms: f64,
    /// Simulated over real time reached lately; 1 is real time.
    pub rate: f64,
    /// Drawn frames whose time counts for nothing yet.
    free: u32,
    /// Real time over which `rate` was measured \[s\].
    watched: f64,
    /// When physics of the last drawn frame was done.
    done: Option<Instant>,
}

impl Default for PhysicsClock {
    fn default() -> Self {
        PhysicsClock {
            running: true,
            speed: 1.0,
            frame: 1.0 / 60.0,
            by_hand: 0,
            budget: Duration::from_millis(200),
            share: Duration::ZERO,
            most_frame: None,
            most_owed: 1.0,
            owed: 0.0,
            lost: 0.0,
            frames: 0,
            now: 0,
            remaining: 0,
            ms: 0.0,
            rate: 0.0,
            free: 0,
            watched: 0.0,
            done: None,
        }
    }
}

impl PhysicsClock {
    /// Part of a frame by which real time is ahead of the world, in [0, 1]: pictures are drawn between the last two
    /// states.
    pub fn ahead(&self) -> f64 {
        if self.running { (self.owed / self.frame).clamp(0.0, 1.0) } else { 1.0 }
    }
    /// Whether physics cannot keep up: it has lately given up time.
    pub fn is_late(&self) -> bool {
        self.running && self.owed > 0.5 * self.most_owed
    }
    /// Forgets what is owed, as where another world begins. It is drawn as it begins: time before it counts for
    /// nothing, nor does the time of the drawn frame that made it, which may be long.
    pub fn restart(&mut self) {
        (self.owed, self.lost, self.rate, self.watched, self.frames, self.free) = (0.0, 0.0, 0.0, 0.0, 0, 2);
    }

    /// Real time passed; how many frames are due.
    fn pass(&mut self, elapsed: f64) -> u32 {
        let elapsed = if self.free > 0 { 0.0 } else { elapsed };
        self.free = self.free.saturating_sub(1);
        if !self.running {
            self.owed = 0.0;
            return std::mem::take(&mut self.by_hand);
        }
        self.by_hand = 0;
        self.owed += elapsed * self.speed;
        if self.owed > self.most_owed {
            self.lost += self.owed - self.most_owed;
            self.owed = self.most_owed;
        }
        // A picture of 16.66 ms is one of a sixtieth: a frame may begin early by as little as that rounding.
        (self.owed / self.frame + 1e-3) as u32
    }
}

/// Does the frames of physics that are due.
pub(crate) fn advance(world: &mut World) {
    let elapsed = world.resource::<Time<Real>>().delta_secs_f64();
    let mut clock = world.resource_mut::<PhysicsClock>();
    let counts = clock.free == 0;
    let due = clock.pass(elapsed);
    clock.now = 0;
    let begin = Instant::now();
    let mut passed = 0.0;
    let budget = clock.done.map_or(clock.budget, |done| clock.budget.max((begin - done).min(clock.share)));
    for k in 0..due {
        if k > 0 && begin.elapsed() > budget {
            break;
        }
        world.resource_mut::<PhysicsClock>().remaining = due - k;
        let (start, from) = (Instant::now(), simulated(world));
        world.run_schedule(PhysicsFrame);
        // A world that was put back has another time.
        let now = (simulated(world) - from).max(0.0);
        passed += now;
        let mut clock = world.resource_mut::<PhysicsClock>();
        clock.ms = start.elapsed().as_secs_f64() * 1e3;
        clock.now += 1;
        clock.frames += 1;
        if clock.running {
            clock.owed = (clock.owed - clock.frame).max(0.0);
            // The rest of a frame that ended early is given up.
            if (1e-6..1.0 - 1e-6).contains(&(now / clock.frame)) {
                clock.lost += clock.frame - now;
            }
        }
    }
    let mut clock = world.resource_mut::<PhysicsClock>();
    clock.done = Some(Instant::now());
    if elapsed > 0.0 && counts {
        // A mean over about a second, or what there is of it.
        let weight = elapsed / (elapsed + clock.watched);
        clock.watched = (clock.watched + elapsed).min(1.0);
        clock.rate += weight * (passed / elapsed - clock.rate);
    }
}

/// Time of the world \[s\]: a frame of physics that ends early simulates less than its length.
fn simulated(world: &World) -> f64 {
    world.get_resource::<Sutura>().map_or(0.0, |s| s.world().time())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_debt_is_bounded_and_what_is_given_up_is_counted() {
        let mut clock = PhysicsClock { most_owed: 0.5, ..PhysicsClock::default() };
        assert_eq!(clock.pass(2.0), 30);
        assert!((clock.lost - 1.5).abs() < 1e-12 && clock.is_late());
        let mut paused = PhysicsClock { running: false, by_hand: 2, ..PhysicsClock::default() };
        assert_eq!((paused.pass(1.0), paused.pass(1.0)), (2, 0));
    }

    #[test]
    fn another_world_begins_at_its_beginning() {
        let mut clock = PhysicsClock::default();
        assert_eq!(clock.pass(0.5), 30);
        clock.restart();
        // The frame in which it is made, and the one that shows how long that took.
        assert_eq!((clock.pass(0.1), clock.pass(5.0), clock.pass(0.1)), (0, 0, 6));
        assert!(clock.lost < 1e-12);
    }

    #[test]
    fn sixty_pictures_of_a_sixtieth_are_sixty_frames() {
        let mut clock = PhysicsClock::default();
        let mut done = 0;
        for _ in 0..60 {
            let due = clock.pass(1.0 / 60.0);
            clock.owed -= f64::from(due) * clock.frame;
            done += due;
        }
        assert_eq!(done, 60);
    }
}
