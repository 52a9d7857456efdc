//! The window tried by itself: everything is shown, every key is pressed and the mouse drags across the picture, as somebody would who wants to see it break.

use crate::control::Viewer;
use crate::keys::{DRIVE, KEYS};
use bevy::input::ButtonState;
use bevy::input::keyboard::{Key, KeyboardInput};
use bevy::input::mouse::MouseButtonInput;
use bevy::prelude::*;
use bevy::window::{CursorMoved, PrimaryWindow, WindowCloseRequested};

/// Pictures before anything is done, so that all is there.
const WARM: u32 = 20;

pub(crate) fn build(app: &mut App) {
    app.add_systems(First, act.before(bevy::ecs::message::MessageUpdateSystems));
}

/// In each picture the next thing is done: a key goes down and up, or the mouse moves with its button down.
fn act(world: &mut World, mut picture: Local<u32>) {
    *picture += 1;
    let Ok((window, size)) = world.query_filtered::<(Entity, &Window), With<PrimaryWindow>>().single(world).map(|(e, w)| (e, w.size())) else { return };
    if *picture == WARM {
        let mut viewer = world.resource_mut::<Viewer>();
        (viewer.tension, viewer.frames, viewer.contacts, viewer.primitives, viewer.help) = (true, true, true, true, true);
    }
    let Some(turn) = picture.checked_sub(WARM + 5) else { return };
    let keys: Vec<KeyCode> = KEYS.iter().map(|k| k.0).chain(DRIVE.into_iter().flatten()).collect();
    let key = |state: ButtonState, key_code: KeyCode| KeyboardInput {
        key_code,
        logical_key: Key::Unidentified(bevy::input::keyboard::NativeKey::Unidentified),
        state,
        text: None,
        repeat: false,
        window,
    };
    let turn = turn as usize;
    if let Some(code) = keys.get(turn / 2) {
        let state = if turn.is_multiple_of(2) { ButtonState::Pressed } else { ButtonState::Released };
        world.write_message(key(state, *code));
        return;
    }
    let turn = turn - 2 * keys.len();
    // Two drags, one with each button, from corner to corner.
    let button = if turn < 20 { MouseButton::Left } else { MouseButton::Right };
    match turn % 20 {
        _ if turn >= 40 => drop(world.write_message(WindowCloseRequested { window })),
        0 => drop(world.write_message(MouseButtonInput { button, state: ButtonState::Pressed, window })),
        19 => drop(world.write_message(MouseButtonInput { button, state: ButtonState::Released, window })),
        k => {
            let position = size * (k as f32 / 20.0);
            if let Some(mut w) = world.get_mut::<Window>(window) {
                w.set_cursor_position(Some(position));
            }
            world.write_message(CursorMoved { window, position, delta: Some(size / 20.0) });
        }
    }
}
