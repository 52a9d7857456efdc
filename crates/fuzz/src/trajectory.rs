//! Recordings. Most changes of one break its checksum, so that inputs are tried as they are and with a checksum that
//! fits.

use crate::input::Input;
use std::sync::OnceLock;
use sutura_scene::Trajectory;

static GOOD: OnceLock<Vec<u8>> = OnceLock::new();

pub fn run(data: &[u8]) {
    let good = GOOD.get_or_init(|| unsealed(crate::saved::outcome().trajectory.to_bytes()));
    let bytes = Input::new(data).changed(good);
    read(&bytes);
    read(&sealed(bytes));
}

/// With the checksum that the readers look for at the end.
pub fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let sum = crc32fast::hash(&bytes);
    bytes.extend_from_slice(&sum.to_le_bytes());
    bytes
}

/// Without it.
pub fn unsealed(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.truncate(bytes.len().saturating_sub(4));
    bytes
}

fn read(bytes: &[u8]) {
    let Ok(trajectory) = Trajectory::from_bytes(bytes) else { return };
    for frame in &trajectory {
        assert!(frame.time.is_finite(), "time of a frame {}", frame.time);
        assert!(frame.positions.iter().flatten().flatten().all(|v| v.is_finite()), "a position that is not finite");
        assert!(frame.orientations.iter().flatten().flatten().all(|v| v.is_finite()), "a frame that is not finite");
        assert!(
            frame.shapes.iter().all(|(x, q)| x.iter().chain(q).all(|v| v.is_finite())),
            "the pose of a shape is not finite"
        );
        assert!(frame.grips.iter().flatten().flatten().all(|v| v.is_finite()), "the place of a grip is not finite");
    }
    assert_eq!(trajectory.nearest(0.5).is_some(), !trajectory.frames.is_empty());
    assert_eq!(Trajectory::from_bytes(&trajectory.to_bytes()).expect("what was read can be written"), trajectory);
}
