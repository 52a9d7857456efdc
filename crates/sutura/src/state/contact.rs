//! Contacts as the next substep starts from them.

use glam::DVec3;

/// What touches, and where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Site {
    /// A place on an element, from 0 at its first particle to 1 at its second.
    Thread { element: u32, s: f64 },
    /// A shape, by its slot, that a thread touches.
    Shape { shape: u32 },
    /// A place on a shape that another one touches, in the frame of the shape.
    Surface { shape: u32, at: DVec3 },
}

/// A contact at the last accepted state. Of two places on threads the one on the element of lower number comes first;
/// where a thread touches a shape the thread does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Contact {
    pub a: Site,
    pub b: Site,
    /// Unit normal from b toward a: the side that a is on.
    pub normal: DVec3,
    /// Normal force and friction force on a \[N\].
    pub normal_force: f64,
    pub friction: DVec3,
    /// Slip that the friction spring has still to undo \[m\].
    pub residual_slip: DVec3,
    pub sliding: bool,
}

/// Those of threads with threads, sorted by elements and places, those of threads with shapes, sorted by shape, element
/// and place, and those of bodies.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Contacts(Vec<Contact>);

impl Site {
    /// Element and place, on a thread.
    pub fn thread(self) -> Option<(u32, f64)> {
        if let Site::Thread { element, s } = self { Some((element, s)) } else { None }
    }
    /// Slot of a shape that a thread touches.
    pub fn shape(self) -> Option<u32> {
        if let Site::Shape { shape } = self { Some(shape) } else { None }
    }
    /// Slot of a shape, whatever touches it.
    pub fn any_shape(self) -> Option<u32> {
        if let Site::Shape { shape } | Site::Surface { shape, .. } = self { Some(shape) } else { None }
    }
    /// What touches, without the place on it.
    pub fn piece(self) -> (u8, u32) {
        match self {
            Site::Thread { element, .. } => (0, element),
            Site::Shape { shape } => (1, shape),
            Site::Surface { shape, .. } => (2, shape),
        }
    }
    /// Place on it, to sort by.
    fn place(self) -> [f64; 3] {
        match self {
            Site::Thread { s, .. } => [s, 0.0, 0.0],
            Site::Shape { .. } => [0.0; 3],
            Site::Surface { at, .. } => at.to_array(),
        }
    }
}

impl Contact {
    /// Force on a \[N\].
    pub fn force(&self) -> DVec3 {
        self.normal * self.normal_force + self.friction
    }
    /// Elements that touch, where both sides are threads.
    pub fn elements(&self) -> Option<(u32, u32)> {
        Some((self.a.thread()?.0, self.b.thread()?.0))
    }
    /// Shape and element that touch.
    pub fn on_shape(&self) -> Option<(u32, u32)> {
        Some((self.b.shape()?, self.a.thread()?.0))
    }
    /// Elements on either side.
    pub fn all_elements(&self) -> impl Iterator<Item = u32> + use<> {
        [self.a, self.b].into_iter().filter_map(|site| site.thread().map(|(element, _)| element))
    }
    /// Both sides, to be changed.
    pub fn sites_mut(&mut self) -> [&mut Site; 2] {
        [&mut self.a, &mut self.b]
    }
    /// The same, seen from the other side.
    fn swap(&mut self) {
        core::mem::swap(&mut self.a, &mut self.b);
        self.normal = -self.normal;
        self.friction = -self.friction;
        self.residual_slip = -self.residual_slip;
    }
    /// In which they are kept.
    pub fn order(&self, other: &Self) -> core::cmp::Ordering {
        let key = |c: &Self| {
            let ((kind, b), (_, a)) = (c.b.piece(), c.a.piece());
            if kind == 0 { (kind, a, b) } else { (kind, b, a) }
        };
        let places = |c: &Self| c.a.place().into_iter().chain(c.b.place());
        let by_place = places(self).zip(places(other)).map(|(x, y)| x.total_cmp(&y)).find(|order| order.is_ne());
        key(self).cmp(&key(other)).then(by_place.unwrap_or(core::cmp::Ordering::Equal))
    }
}

impl Contacts {
    /// Takes contacts in any order.
    pub fn set(&mut self, contacts: impl Iterator<Item = Contact>) {
        self.0.clear();
        self.0.extend(contacts);
        self.0.sort_unstable_by(Contact::order);
    }
    pub fn clear(&mut self) {
        self.0.clear();
    }
    pub fn iter(&self) -> core::slice::Iter<'_, Contact> {
        self.0.iter()
    }
    /// Those of threads with threads.
    pub fn threads(&self) -> &[Contact] {
        &self.0[..self.split(1)]
    }
    /// Those of threads with shapes.
    pub fn shapes(&self) -> &[Contact] {
        &self.0[self.split(1)..self.split(2)]
    }
    /// Those of bodies with each other and with other shapes.
    pub fn bodies(&self) -> &[Contact] {
        &self.0[self.split(2)..]
    }
    pub fn retain(&mut self, keep: impl Fn(&Contact) -> bool) {
        self.0.retain(keep);
    }
    /// Changes sites, and what goes with that the order. What comes to touch itself is dropped.
    pub fn rename(&mut self, name: impl Fn(Site) -> Site) {
        for c in &mut self.0 {
            for site in c.sites_mut() {
                *site = name(*site);
            }
            if c.elements().is_some_and(|(a, b)| a > b) {
                c.swap();
            }
        }
        self.0.retain(|c| c.elements().is_none_or(|(a, b)| a < b));
        self.0.sort_unstable_by(Contact::order);
    }
    pub fn copy_from(&mut self, other: &Self) {
        self.0.clone_from(&other.0);
    }
    fn split(&self, kind: u8) -> usize {
        self.0.partition_point(|c| c.b.piece().0 < kind)
    }
}
