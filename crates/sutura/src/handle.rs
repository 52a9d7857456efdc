//! Handles: 8-byte names of things in a [`World`](crate::World). Outside the engine only handles are seen, inside only
//! `u32`.

use core::marker::PhantomData;

/// Names one `T` of a world. Stays valid while the thing lives; a later thing in the same slot has another generation.
pub struct Handle<T> {
    pub(crate) index: u32,
    pub(crate) generation: u32,
    kind: PhantomData<fn() -> T>,
}

impl<T> Handle<T> {
    pub(crate) fn new(index: u32, generation: u32) -> Self {
        Handle { index, generation, kind: PhantomData }
    }
    /// Slot of the thing, for use as a dense key. Unique among the living things of its kind.
    pub fn index(self) -> usize {
        self.index as usize
    }
}

impl<T> Clone for Handle<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for Handle<T> {}
impl<T> PartialEq for Handle<T> {
    fn eq(&self, other: &Self) -> bool {
        self.index == other.index && self.generation == other.generation
    }
}
impl<T> Eq for Handle<T> {}
impl<T> core::fmt::Debug for Handle<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "#{}.{}", self.index, self.generation)
    }
}

/// Slots with generations. Iteration is in slot order, so it is reproducible.
#[derive(Debug, Clone)]
pub(crate) struct Slots<T> {
    slots: Vec<(u32, Option<T>)>,
}

impl<T> Default for Slots<T> {
    fn default() -> Self {
        Slots { slots: Vec::new() }
    }
}

impl<T> Slots<T> {
    pub(crate) fn insert<K>(&mut self, value: T) -> Handle<K> {
        if let Some(i) = self.slots.iter().position(|(_, v)| v.is_none()) {
            // A damaged snapshot may hold any generation.
            self.slots[i].0 = self.slots[i].0.wrapping_add(1);
            self.slots[i].1 = Some(value);
            return Handle::new(i as u32, self.slots[i].0);
        }
        self.slots.push((0, Some(value)));
        Handle::new(self.slots.len() as u32 - 1, 0)
    }
    pub(crate) fn get<K>(&self, h: Handle<K>) -> Option<&T> {
        self.slots.get(h.index as usize).filter(|(g, _)| *g == h.generation).and_then(|(_, v)| v.as_ref())
    }
    pub(crate) fn get_mut<K>(&mut self, h: Handle<K>) -> Option<&mut T> {
        self.slots.get_mut(h.index as usize).filter(|(g, _)| *g == h.generation).and_then(|(_, v)| v.as_mut())
    }
    pub(crate) fn remove<K>(&mut self, h: Handle<K>) -> Option<T> {
        self.slots.get_mut(h.index as usize).filter(|(g, _)| *g == h.generation).and_then(|(_, v)| v.take())
    }
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u32, &T)> {
        self.slots.iter().enumerate().filter_map(|(i, (_, v))| v.as_ref().map(|v| (i as u32, v)))
    }
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = (u32, &mut T)> {
        self.slots.iter_mut().enumerate().filter_map(|(i, (_, v))| v.as_mut().map(|v| (i as u32, v)))
    }
    /// A copy into memory that is already there.
    pub(crate) fn copy_from(&mut self, from: &Self)
    where
        T: Clone,
    {
        self.slots.clone_from(&from.slots);
    }
    /// The values in slots that have the generations of others.
    pub(crate) fn like<U>(&self, other: &Slots<U>) -> Self
    where
        T: Clone,
    {
        let value = |k: usize| self.slots.get(k).and_then(|(_, v)| v.clone());
        Slots { slots: other.slots.iter().enumerate().map(|(k, (g, _))| (*g, value(k))).collect() }
    }
    /// Empties a slot.
    pub(crate) fn empty(&mut self, index: u32) {
        self.slots[index as usize].1 = None;
    }
    pub(crate) fn retain(&mut self, keep: impl Fn(&T) -> bool) {
        for (_, slot) in &mut self.slots {
            if slot.as_ref().is_some_and(|v| !keep(v)) {
                *slot = None;
            }
        }
    }
    /// The handle of the living thing in a slot.
    pub(crate) fn handle<K>(&self, index: u32) -> Handle<K> {
        Handle::new(index, self.slots[index as usize].0)
    }
    pub(crate) fn raw(&self) -> &Vec<(u32, Option<T>)> {
        &self.slots
    }
    pub(crate) fn from_raw(slots: Vec<(u32, Option<T>)>) -> Self {
        Slots { slots }
    }
    /// What is in each slot, up to the last that is not empty.
    pub(crate) fn values(&self) -> Vec<Option<T>>
    where
        T: Clone,
    {
        let n = self.slots.iter().rposition(|(_, v)| v.is_some()).map_or(0, |last| last + 1);
        self.slots[..n].iter().map(|(_, v)| v.clone()).collect()
    }
    pub(crate) fn of_values(values: Vec<Option<T>>) -> Self {
        Slots { slots: values.into_iter().map(|v| (0, v)).collect() }
    }
    pub(crate) fn len(&self) -> usize {
        self.slots.len()
    }
    pub(crate) fn at(&self, index: u32) -> Option<&T> {
        self.slots.get(index as usize).and_then(|(_, v)| v.as_ref())
    }
    pub(crate) fn at_mut(&mut self, index: u32) -> Option<&mut T> {
        self.slots.get_mut(index as usize).and_then(|(_, v)| v.as_mut())
    }
}
