//! The order of sections that a file must have (spec 2.3).

use super::error::Error;
use super::section::{Section, SectionKind, name_of};

/// The sections of known kinds in the order of the file, as they are taken one by one.
pub(super) struct SectionOrder<'a, 'b> {
    sections: &'b [&'a Section],
    next: usize,
}

impl<'a, 'b> SectionOrder<'a, 'b> {
    /// The order of `sections`, of which none is taken yet.
    pub(super) fn new(sections: &'b [&'a Section]) -> Self {
        Self { sections, next: 0 }
    }

    /// The next section of the whole scene, if it has this kind.
    pub(super) fn take_whole_if(&mut self, kind: SectionKind) -> Option<&'a Section> {
        self.take_if(kind, None, None)
    }

    /// The next section of the whole scene, which must have this kind.
    pub(super) fn take_whole(&mut self, kind: SectionKind) -> Result<&'a Section, Error> {
        self.take(kind, None, None)
    }

    /// The next section, if it is this one.
    fn take_if(&mut self, kind: SectionKind, scale: Option<u16>, chunk: Option<u32>) -> Option<&'a Section> {
        let section = self.sections.get(self.next).filter(|s| s.is_at(kind, scale, chunk))?;
        self.next += 1;
        Some(section)
    }

    /// The next section, which must be this one.
    fn take(&mut self, kind: SectionKind, scale: Option<u16>, chunk: Option<u32>) -> Result<&'a Section, Error> {
        if let Some(section) = self.take_if(kind, scale, chunk) {
            return Ok(section);
        }
        let name = name_of(kind, scale, chunk);
        let elsewhere = self.sections.iter().any(|s| s.is_at(kind, scale, chunk));
        Err(match self.sections.get(self.next) {
            Some(found) if elsewhere => Error::malformed("next section", name, found),
            _ => Error::MissingSection { name },
        })
    }

    /// Checks that every section was taken.
    pub(super) fn finish(&self) -> Result<(), Error> {
        match self.sections.get(self.next) {
            None => Ok(()),
            Some(section) => Err(Error::malformed("next section", "of an unknown kind", section)),
        }
    }
}

/// The sections of one scale.
pub(super) struct ScaleSections<'a> {
    pub(super) scale: &'a Section,
    pub(super) matrix: &'a Section,
    /// \[chunk\] placement, density, appearance.
    pub(super) chunks: Vec<[&'a Section; 3]>,
    pub(super) prefix: Option<&'a Section>,
}

impl<'a> ScaleSections<'a> {
    /// Takes the sections of scale `index`.
    pub(super) fn take(order: &mut SectionOrder<'a, '_>, index: u16, may_have_prefix: bool) -> Result<Self, Error> {
        let scale = order.take(SectionKind::Scale, Some(index), None)?;
        let matrix = order.take(SectionKind::Matrix, Some(index), None)?;
        let mut chunks = Vec::new();
        // Their number is compared with that in SCALE later.
        let mut next = Some(order.take(SectionKind::Placement, Some(index), Some(0))?);
        while let Some(placement) = next {
            let chunk = Some(chunks.len() as u32);
            let density = order.take(SectionKind::Density, Some(index), chunk)?;
            chunks.push([placement, density, order.take(SectionKind::Appearance, Some(index), chunk)?]);
            next = order.take_if(SectionKind::Placement, Some(index), Some(chunks.len() as u32));
        }
        let prefix = if may_have_prefix { order.take_if(SectionKind::Prefix, Some(index), None) } else { None };
        Ok(Self { scale, matrix, chunks, prefix })
    }
}
