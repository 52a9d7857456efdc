//! Tips of instruments where grips hold: looks only.

use crate::camera::Orbit;
use crate::control::Viewer;
use crate::source::Play;
use crate::stage::Stage;
use bevy::prelude::*;
use sutura_bevy::sutura::glam::DVec3;
use sutura_bevy::sutura::{self, Handle};
use sutura_bevy::{Grip, Space, Sutura, Tip};

/// Grips nearer to each other than this are held by one instrument \[m\].
const TOGETHER: f64 = 2.5e-3;
/// Length of thread over which its direction is told \[m\].
const ALONG: f64 = 8e-3;
/// Time in which an instrument turns to where the hand is \[s\].
const LAG: f64 = 0.15;
const SCENES: Srgba = Srgba::rgb(0.93, 0.68, 0.22);
const HANDS: Srgba = Srgba::rgb(0.98, 0.35, 0.12);

/// An instrument of a grip.
#[derive(Component, Debug)]
pub struct Instrument {
    grip: Handle<sutura::Grip>,
    /// To the hand, axes of the engine.
    hand: DVec3,
    time: f64,
    /// Axes of the picture then.
    axes: [DVec3; 3],
}

/// What a grip holds.
struct Holding {
    grip: Handle<sutura::Grip>,
    band: Srgba,
    at: DVec3,
    tangent: DVec3,
    /// Away from the thread, where it holds an end.
    outward: DVec3,
    bore: f64,
}

impl Holding {
    fn of(world: &sutura::World, grip: Handle<sutura::Grip>, band: Srgba) -> Option<Holding> {
        let at = world.grip_pose(grip).ok()?.position;
        let mut best: Option<(f64, Holding)> = None;
        for rod in world.view().rods() {
            let x = rod.positions();
            let Some((i, d)) = x.iter().map(|p| p.distance_squared(at)).enumerate().min_by(|a, b| a.1.total_cmp(&b.1))
            else {
                continue;
            };
            if best.as_ref().is_some_and(|b| b.0 <= d) {
                continue;
            }
            let (after, rest_after) = walk(x[i..].iter());
            let (before, rest_before) = walk(x[..=i].iter().rev());
            let outward = if rest_before < 0.5 * ALONG {
                (x[i] - after).normalize_or_zero()
            } else if rest_after < 0.5 * ALONG {
                (x[i] - before).normalize_or_zero()
            } else {
                DVec3::ZERO
            };
            best = Some((
                d,
                Holding {
                    grip,
                    band,
                    at,
                    tangent: (after - before).normalize_or(DVec3::X),
                    outward,
                    bore: 2.0 * rod.radius(),
                },
            ));
        }
        best.map(|b| b.1)
    }

    /// Where its hand is: beyond the end of the thread, above the table, on its side of the picture.
    fn hand(&self, [right, above, back]: [DVec3; 3], middle: DVec3) -> DVec3 {
        let side = ((self.at - middle).dot(right) / 0.02).clamp(-1.0, 1.0);
        let free = above * 0.8 + back * 0.35 + right * (0.5 * side);
        let across = free - self.tangent * (0.7 * free.dot(self.tangent));
        (across + self.outward * 1.4).normalize_or(above)
    }
}

/// The particle at some length along, and how much of it there was.
fn walk<'a>(mut x: impl Iterator<Item = &'a DVec3>) -> (DVec3, f64) {
    let mut last = *x.next().unwrap_or(&DVec3::ZERO);
    let mut length = 0.0;
    for p in x {
        length += p.distance(last);
        last = *p;
        if length >= ALONG {
            break;
        }
    }
    (last, length)
}

/// Puts an instrument at each grip of the present.
pub fn show(
    mut commands: Commands,
    viewer: Res<Viewer>,
    stage: Res<Stage>,
    space: Res<Space>,
    sutura: Res<Sutura>,
    orbit: Res<Orbit>,
    grips: Query<&Grip>,
    mut shown: Query<(Entity, &mut Instrument, &mut Transform)>,
) {
    let world = sutura.world();
    let mut wanted: Vec<Holding> = Vec::new();
    if viewer.instruments && stage.past.is_none() {
        let hands = grips.iter().filter_map(Grip::handle).map(|h| (h, HANDS));
        let scenes = sutura
            .simulation::<Play>()
            .into_iter()
            .flat_map(|p| p.0.grips().filter_map(|(_, h)| h))
            .map(|h| (h, SCENES));
        for (grip, band) in hands.chain(scenes) {
            if let Some(holding) =
                Holding::of(world, grip, band).filter(|h| wanted.iter().all(|w| w.at.distance(h.at) > TOGETHER))
            {
                wanted.push(holding);
            }
        }
    }
    for (entity, instrument, _) in &shown {
        if !wanted.iter().any(|h| h.grip == instrument.grip) {
            commands.entity(entity).despawn();
        }
    }
    let axis = |v: Vec3| space.direction_back(v).normalize_or_zero();
    let (back, right) = (axis(orbit.home_direction()), axis(orbit.home_right()));
    let axes = [right, back.cross(right), back];
    let middle = space.place_back(orbit.home_target());
    for holding in &wanted {
        let (goal, time) = (holding.hand(axes, middle), world.time());
        let place = |hand: DVec3| space.transform(Tip::pose(holding.at, holding.tangent, hand));
        match shown.iter_mut().find(|(_, i, _)| i.grip == holding.grip) {
            Some((_, mut instrument, mut transform)) => {
                // Looked at anew it is where it is to be.
                let part =
                    if instrument.axes == axes { 1.0 - (-(time - instrument.time).max(0.0) / LAG).exp() } else { 1.0 };
                instrument.hand = instrument.hand.lerp(goal, part).normalize_or(goal);
                (instrument.time, instrument.axes) = (time, axes);
                *transform = place(instrument.hand);
            }
            None => {
                let tip = Tip { bore: holding.bore, band: holding.band };
                commands.spawn((tip, Instrument { grip: holding.grip, hand: goal, time, axes }, place(goal)));
            }
        }
    }
}
