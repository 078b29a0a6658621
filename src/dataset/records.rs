//! Bad records among many good ones: a pose that is not finite, a photograph that cannot be decoded.

use super::Error;

/// Of so many records one may be bad, and at least one of all.
const RECORDS_PER_BAD: usize = 100;

/// The most bad records of `total` that are left out: one percent, at least one, and not all.
pub(super) fn most_bad(total: usize) -> usize {
    (total / RECORDS_PER_BAD).max(1).min(total.saturating_sub(1))
}

/// The records that were left out.
#[derive(Debug, Default)]
pub(super) struct BadRecords {
    errors: Vec<Error>,
}

impl BadRecords {
    pub(super) fn add(&mut self, error: Error) {
        self.errors.push(error);
    }

    /// The value of a record; `None` if it is bad.
    pub(super) fn keep<T>(&mut self, record: Result<T, Error>) -> Option<T> {
        record.map_err(|error| self.add(error)).ok()
    }

    /// A photograph, or the error that is not for its picture alone; `None` if its picture cannot be decoded.
    pub(super) fn keep_readable<T>(&mut self, record: Result<T, Error>) -> Option<Result<T, Error>> {
        match record {
            Err(error @ (Error::Picture { .. } | Error::PictureFormat { .. })) => {
                self.add(error);
                None
            }
            other => Some(other),
        }
    }

    /// Number of records that were left out.
    pub(super) fn len(&self) -> usize {
        self.errors.len()
    }

    /// [`BadRecords::tolerated`] beside `good` records.
    pub(super) fn tolerated_beside(self, good: usize) -> Result<Vec<Error>, Error> {
        let total = good + self.len();
        self.tolerated(total)
    }

    /// The errors of the records that were left out, if they are few enough of `total`.
    ///
    /// # Errors
    ///
    /// [`Error::BadRecords`].
    pub(super) fn tolerated(self, total: usize) -> Result<Vec<Error>, Error> {
        let (count, limit) = (self.errors.len(), most_bad(total));
        if count <= limit {
            return Ok(self.errors);
        }
        let mut errors = self.errors.into_iter();
        match errors.next() {
            Some(first) if count > 1 => Err(Error::BadRecords { first: Box::new(first), count, total, limit }),
            Some(first) => Err(first),
            None => Ok(Vec::new()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_percent_may_be_bad_and_at_least_one() {
        assert_eq!([0, 1, 2, 25, 199, 200, 1000].map(most_bad), [0, 0, 1, 1, 1, 2, 10]);
    }

    #[test]
    fn the_first_of_too_many_is_named_with_their_count() {
        let bad = |count: usize| BadRecords {
            errors: (0..count).map(|n| Error::text("a".as_ref(), format!("frame {n}"), "finite", "NaN")).collect(),
        };
        assert_eq!(bad(1).tolerated(2).unwrap().len(), 1);
        let message = bad(3).tolerated(25).unwrap_err().to_string();
        assert_eq!(message, "a: frame 0 must be finite; found NaN; 3 of 25 are such, of which at most 1 is left out");
        assert_eq!(bad(1).tolerated(1).unwrap_err().to_string(), "a: frame 0 must be finite; found NaN");
    }
}
