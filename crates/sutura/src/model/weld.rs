//! Places of threads that are joined with each other or with a body: a ring closed, a branch, a splice, a needle.

use crate::error::Error;
use crate::error::check;
use crate::handle::Handle;
use crate::math::Pose;
use crate::model::Model;
use crate::model::body::Body;
use crate::model::grip::Place;
use crate::model::rod::Rod;
use glam::{DQuat, DVec3};

/// A weld. Marker of [`Handle`].
#[derive(Debug)]
pub enum Weld {}

/// Places to join. They become one cross-section: one point with one orientation, which every thread there holds as a
/// clamp does, with half an element of its own compliance on each side.
#[derive(Debug, Clone)]
pub struct WeldSpec {
    /// The places, at least two, or one on a body; ends or inner particles, no place twice. They lie within a tenth of
    /// the smallest radius of each other.
    pub places: Vec<(Handle<Rod>, Place)>,
    /// Shape of the joint when nothing acts on it.
    pub rest: WeldRest,
    /// The body that they are joined to, if any.
    pub anchor: Option<WeldAnchor>,
}

/// Where a body holds threads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeldAnchor {
    /// The body.
    pub body: Handle<Body>,
    /// Where on it, in its own frame \[m\]: not farther from the places than a tenth of a radius.
    pub point: DVec3,
    /// Pull on the body at which the threads come off \[N\], > 0; `None` where they never do.
    pub strength: Option<f64>,
}

/// Shape of a weld at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WeldRest {
    /// The directions in which threads end there now are free of moment. A thread that goes on through the weld keeps
    /// its own rest shape.
    AsInserted,
    /// Two ends that go on straight into each other, without moment where their directions agree; turned about their
    /// direction as they are now.
    Straight,
    /// They are joined at a point and turn about it freely, as on a ball; of places on a body only. A thread that goes
    /// on through the point keeps its own joint there.
    Loose,
}

/// A weld, checked.
#[derive(Debug, Clone)]
pub(crate) struct WeldModel {
    pub members: Vec<Member>,
    /// Where it is on a body, if it is on one.
    pub anchor: Option<Anchor>,
    /// Elements of joined threads that are nearer to each other by way of the weld than this do not touch \[m\].
    pub filter_distance: f64,
}

/// Where a weld is on a body, in that one's principal frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Anchor {
    pub body: u32,
    pub pose: Pose,
    /// Force on the body from which on the threads come off \[N\].
    pub strength: f64,
    /// Elements that are nearer to it along their thread than this do not touch the body \[m\].
    pub filter_distance: f64,
}

/// A thread at a weld.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Member {
    /// Slot of the thread, and the particle counted from its start.
    pub rod: u32,
    pub particle: u32,
    /// What its frames before and after the place hold on to.
    pub before: Option<Side>,
    pub after: Option<Side>,
}

/// How a thread leaves a weld on one side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Side {
    /// The thread's own cross-section there, `weld_from_section`, so that the half joint bends and twists about its own
    /// directions.
    pub section: DQuat,
    /// Square root of the rest rotation over the half element beside it.
    pub rest_half: DQuat,
}

/// Half a joint between a weld and a frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Half {
    /// Element of the frame in the world's arrays.
    pub frame: usize,
    /// The weld comes before the frame along the thread.
    pub first: bool,
    pub side: Side,
}

impl WeldModel {
    /// Whether it joins anything.
    pub fn joins(&self) -> bool {
        self.members.len() + usize::from(self.anchor.is_some()) >= 2
    }
    /// Its half joints, member by member.
    pub fn halves<'a>(&'a self, model: &'a Model) -> impl Iterator<Item = Half> + 'a {
        self.members.iter().flat_map(|m| m.halves(model))
    }
}

impl Member {
    /// Its particle in the world's arrays.
    pub fn index(&self, model: &Model) -> usize {
        (model.rods.at(self.rod).expect("welds go with their rods").first + self.particle) as usize
    }
    pub fn halves(&self, model: &Model) -> impl Iterator<Item = Half> + use<> {
        let i = self.index(model);
        let before = self.before.map(|side| Half { frame: i - 1, first: false, side });
        before.into_iter().chain(self.after.map(|side| Half { frame: i, first: true, side }))
    }
}

impl Side {
    /// With the cross-section of the weld.
    pub fn along(rest_half: DQuat) -> Self {
        Side { section: DQuat::IDENTITY, rest_half }
    }
    /// At rest where its frame is now.
    pub fn turned(weld: DQuat, frame: DQuat) -> Self {
        Side { section: (weld.conjugate() * frame).normalize(), rest_half: DQuat::IDENTITY }
    }
}

/// Rest rotation from the frame that ends at one place of a weld to the frame that begins at another; places are slots
/// of threads and particles.
pub(crate) fn rest_across(members: &[Member], before: (u32, u32), after: (u32, u32)) -> Option<DQuat> {
    let of = |place: (u32, u32)| members.iter().find(|m| (m.rod, m.particle) == place);
    let (before, after) = (of(before)?.before?, of(after)?.after?);
    let half = before.rest_half * before.rest_half * before.section.conjugate();
    Some(half * after.section * after.rest_half * after.rest_half)
}

impl WeldSpec {
    /// Joins ends or inner particles as they lie.
    pub fn new(places: Vec<(Handle<Rod>, Place)>) -> Self {
        WeldSpec { places, rest: WeldRest::AsInserted, anchor: None }
    }
    /// Splices two ends so that they go on straight into each other.
    pub fn splice(a: (Handle<Rod>, Place), b: (Handle<Rod>, Place)) -> Self {
        WeldSpec { places: vec![a, b], rest: WeldRest::Straight, anchor: None }
    }
    /// Attaches a place of a thread to a body, at a point of the body's frame, with its direction as it is now.
    pub fn to_body(place: (Handle<Rod>, Place), body: Handle<Body>, point: DVec3) -> Self {
        let anchor = Some(WeldAnchor { body, point, strength: None });
        WeldSpec { places: vec![place], rest: WeldRest::AsInserted, anchor }
    }

    pub(crate) fn validate(&self) -> Result<(), Error> {
        let on_body = self.anchor.is_some();
        match (on_body, self.rest) {
            (true, WeldRest::Straight) => {
                return Err(Error::invalid("weld", "rest", self.rest, "as inserted or loose, on a body"));
            }
            (false, WeldRest::Loose) => return Err(Error::invalid("weld", "rest", self.rest, "loose on a body only")),
            _ => {}
        }
        if let Some(anchor) = &self.anchor {
            if let Some(strength) = anchor.strength {
                check("weld", "strength", strength, strength > 0.0, "a force > 0 [N]")?;
            }
            if !anchor.point.is_finite() {
                return Err(Error::invalid("weld", "point", anchor.point, "a finite place"));
            }
        }
        let least = if on_body { 1 } else { 2 };
        if self.places.len() < least || self.rest == WeldRest::Straight && self.places.len() != 2 {
            return Err(Error::invalid(
                "weld",
                "places",
                self.places.len(),
                "at least two places, or one on a body; two where they go on straight",
            ));
        }
        Ok(())
    }
}
