//! The keys: the one table of what each does, for the hand and for the help.

use bevy::prelude::*;

/// What a key does when it goes down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Plays or pauses.
    PlayPause,
    /// One frame of physics, or of a recording.
    Step,
    /// From the beginning.
    Reset,
    /// Half the speed.
    Slower,
    /// Twice the speed.
    Faster,
    /// A tenth of a second back.
    Back,
    /// A tenth of a second on, up to the present.
    Forward,
    /// To the first frame.
    First,
    /// To the present, or the end of a recording.
    Latest,
    /// The camera where it was at first.
    Home,
    /// Tension as color.
    Tension,
    /// Material frames.
    Frames,
    /// Contacts.
    Contacts,
    /// Collision primitives.
    Primitives,
    /// Instruments.
    Instruments,
    /// Which knot it is.
    Knot,
    /// Panels.
    Panels,
    /// Help.
    Help,
    /// Takes or lets go with grip A (0) or B (1).
    Take(usize),
    /// What was taken over of the scene goes back to it.
    GiveBack,
    /// Writes a picture.
    Picture,
    /// Begins or ends a sequence of pictures.
    Sequence,
    /// Writes what was shown so far as GLB.
    Glb,
    /// Writes what was done so far, to be done again.
    Input,
    /// The next sample scene.
    NextScene,
    /// The one before.
    LastScene,
    /// Closes help and messages, lets everything go.
    Dismiss,
}

/// Keys that act when they go down: key, its name, what it does in words.
pub const KEYS: &[(KeyCode, &str, &str, Action)] = &[
    (KeyCode::Space, "Space", "play, pause", Action::PlayPause),
    (KeyCode::Period, ".", "one frame", Action::Step),
    (KeyCode::Backspace, "Backspace", "from the beginning", Action::Reset),
    (KeyCode::BracketLeft, "[", "half the speed", Action::Slower),
    (KeyCode::BracketRight, "]", "twice the speed", Action::Faster),
    (KeyCode::ArrowLeft, "Left", "back by 0.1 s", Action::Back),
    (KeyCode::ArrowRight, "Right", "on by 0.1 s, up to the present", Action::Forward),
    (KeyCode::Home, "Home", "to the first frame", Action::First),
    (KeyCode::End, "End", "to the present", Action::Latest),
    (KeyCode::KeyF, "F", "the camera where it was at first", Action::Home),
    (KeyCode::KeyT, "T", "tension as color", Action::Tension),
    (KeyCode::KeyV, "V", "material frames", Action::Frames),
    (KeyCode::KeyC, "C", "contacts: normals, and friction that sticks (green) or slips (orange)", Action::Contacts),
    (KeyCode::KeyP, "P", "collision primitives", Action::Primitives),
    (KeyCode::KeyH, "H", "instruments where grips hold", Action::Instruments),
    (KeyCode::KeyB, "B", "which knot it is", Action::Knot),
    (KeyCode::Digit1, "1", "grip A takes the start of the first thread, or lets go", Action::Take(0)),
    (KeyCode::Digit2, "2", "grip B takes the end of the last thread, or lets go", Action::Take(1)),
    (KeyCode::KeyG, "G", "give back to the scene what was taken over and is held no more", Action::GiveBack),
    (KeyCode::F5, "F5", "write what was done so far (sutura replay)", Action::Input),
    (KeyCode::F9, "F9", "write what was shown so far as GLB", Action::Glb),
    (KeyCode::F11, "F11", "begin or end a sequence of pictures", Action::Sequence),
    (KeyCode::F12, "F12", "write a picture", Action::Picture),
    (KeyCode::PageDown, "Page down", "next sample scene", Action::NextScene),
    (KeyCode::PageUp, "Page up", "sample scene before", Action::LastScene),
    (KeyCode::Tab, "Tab", "panels", Action::Panels),
    (KeyCode::F1, "F1", "this help", Action::Help),
    (KeyCode::Slash, "?", "this help", Action::Help),
    (KeyCode::Escape, "Esc", "close help and messages, let go", Action::Dismiss),
];

/// Keys that move a grip while they are down: left, right, down, up, away, nearer, twist one way and the other, as seen
/// in the picture.
pub const DRIVE: [[KeyCode; 8]; 2] = [
    [
        KeyCode::KeyA,
        KeyCode::KeyD,
        KeyCode::KeyS,
        KeyCode::KeyW,
        KeyCode::KeyQ,
        KeyCode::KeyE,
        KeyCode::KeyZ,
        KeyCode::KeyX,
    ],
    [
        KeyCode::KeyJ,
        KeyCode::KeyL,
        KeyCode::KeyK,
        KeyCode::KeyI,
        KeyCode::KeyU,
        KeyCode::KeyO,
        KeyCode::KeyN,
        KeyCode::KeyM,
    ],
];

/// What else there is to do, in words.
pub const OTHERS: &[(&str, &str)] = &[
    ("left drag", "take a thread or body and move it; beside everything: turn the view"),
    ("wheel while held", "what is held nearer or farther"),
    ("right drag", "turn the view"),
    ("middle drag", "move the view"),
    ("wheel", "nearer or farther"),
    ("W A S D, Q E, Z X", "move grip A up, left, down, right, away, nearer; twist it"),
    ("I J K L, U O, N M", "the same with grip B"),
    ("Shift", "four times as fast"),
    ("drop a file", "open a scene or a recording"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_has_two_meanings_and_the_manual_has_them_all() {
        let mut codes: Vec<KeyCode> = KEYS.iter().map(|k| k.0).chain(DRIVE.into_iter().flatten()).collect();
        let n = codes.len();
        codes.sort();
        codes.dedup();
        assert_eq!(codes.len(), n);
        let manual = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/viewer.md")).unwrap();
        for (key, what) in KEYS.iter().map(|k| (k.1, k.2)).chain(OTHERS.iter().copied()) {
            assert!(manual.contains(&format!("| {key} | {what} |")), "docs/viewer.md lacks `| {key} | {what} |`");
        }
    }
}
