//! Closest points and times of impact.
pub(crate) struct Collider;
