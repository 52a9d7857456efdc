//! Instruments: put in, closed, opened, taken out. They are bodies and joints, and nothing else.

use super::World;
use crate::error::Error;
use crate::model::body::BodyMotion;
use crate::model::instrument::{Instrument, InstrumentSpec};

impl World {
    /// Adds an instrument, whose jaw opens. Its handle is driven: [`World::set_body_pose`] leads it.
    pub fn insert_instrument(&mut self, spec: &InstrumentSpec) -> Result<Instrument, Error> {
        let drive = |world: &mut World, handle| world.set_body_motion(handle, BodyMotion::Driven);
        spec.insert(self, World::insert_body, drive, World::insert_joint)
    }

    /// Closes the jaws of an instrument, or opens them.
    pub fn close_jaws(&mut self, instrument: &Instrument, spec: &InstrumentSpec, close: bool) -> Result<(), Error> {
        self.set_joint_motor(instrument.hinge, Some(spec.motor(close)))
    }

    /// Takes an instrument out, with what is joined to it. What its handle held is free.
    pub fn remove_instrument(&mut self, instrument: &Instrument) -> Result<(), Error> {
        [instrument.jaw, instrument.handle].into_iter().try_for_each(|body| self.remove_body(body))
    }
}
