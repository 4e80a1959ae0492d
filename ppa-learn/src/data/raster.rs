//! Images of one channel in memory.

use super::error::DataError;

/// An image of one channel, row-major from the top left; it has at least one pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Raster<T> {
    width: usize,
    height: usize,
    values: Vec<T>,
}

impl<T: Copy> Raster<T> {
    /// Makes an image from `width * height` values.
    ///
    /// # Errors
    /// [`DataError::Length`] if there are no values or their number differs.
    pub fn new(width: usize, height: usize, values: Vec<T>) -> Result<Self, DataError> {
        if values.is_empty() || width.checked_mul(height) != Some(values.len()) {
            return Err(DataError::Length {
                width,
                height,
                found: values.len(),
            });
        }
        Ok(Self {
            width,
            height,
            values,
        })
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels, row by row.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The pixels, row by row.
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// The pixels, row by row.
    pub fn into_values(self) -> Vec<T> {
        self.values
    }

    /// One row.
    pub(super) fn row(&self, y: usize) -> &[T] {
        &self.values[y * self.width..][..self.width]
    }

    /// Makes an image of the same size row by row.
    pub(super) fn map_rows<U: Copy>(&self, mut row: impl FnMut(usize, &mut Vec<U>)) -> Raster<U> {
        let mut values = Vec::with_capacity(self.values.len());
        for y in 0..self.height {
            row(y, &mut values);
        }
        debug_assert_eq!(values.len(), self.values.len());
        Raster {
            width: self.width,
            height: self.height,
            values,
        }
    }

    /// Applies `change` to every pixel.
    pub fn map<U: Copy>(&self, change: impl Fn(T) -> U) -> Raster<U> {
        self.map_rows(|y, values| values.extend(self.row(y).iter().map(|&value| change(value))))
    }

    /// Returns the part of the image in columns `x..x + width` and rows `y..y + height`, truncated at the border as with NumPy
    /// slices. `None` if nothing is left.
    pub fn crop(&self, x: usize, y: usize, width: usize, height: usize) -> Option<Self> {
        let columns = x.min(self.width)..x.saturating_add(width).min(self.width);
        let rows = y.min(self.height)..y.saturating_add(height).min(self.height);
        let values: Vec<T> = rows
            .clone()
            .flat_map(|y| &self.row(y)[columns.clone()])
            .copied()
            .collect();
        Self::new(columns.len(), rows.len(), values).ok()
    }

    /// The image mirrored left to right.
    pub fn mirrored(&self) -> Self {
        self.map_rows(|y, values| values.extend(self.row(y).iter().rev()))
    }

    /// Resizes the image by nearest neighbours, so that no depths are mixed.
    ///
    /// Pixel i of the result is pixel floor((i + ½) · old / new) of the image, where the scale has 16 binary places, as in
    /// OpenCV's INTER_NEAREST_EXACT.
    ///
    /// # Panics
    /// If `width` or `height` is 0.
    pub fn resized(&self, width: usize, height: usize) -> Self {
        assert!(width > 0 && height > 0, "an image has at least one pixel");
        let columns = nearest_sources(self.width, width);
        let rows = nearest_sources(self.height, height);
        let mut values = Vec::with_capacity(width * height);
        for y in rows {
            let row = self.row(y);
            values.extend(columns.iter().map(|&x| row[x]));
        }
        Self {
            width,
            height,
            values,
        }
    }
}

/// Returns the index among `old` pixels of a side for each of `new` pixels.
fn nearest_sources(old: usize, new: usize) -> Vec<usize> {
    let (old, new) = (old as i64, new as i64);
    let scale = ((old << 16) + new / 2) / new;
    // Half a scale; at exact ties an odd side takes the smaller neighbour.
    let first = scale / 2 - old % 2;
    (0..new)
        .map(|i| ((scale * i + first) >> 16).clamp(0, old - 1) as usize)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crop_keeps_what_lies_within() {
        let image = Raster::new(3, 2, vec![1, 2, 3, 4, 5, 6]).unwrap();
        let corner = image.crop(1, 1, 5, usize::MAX).unwrap();
        assert_eq!(
            (corner.width(), corner.height(), corner.values()),
            (2, 1, &[5, 6][..])
        );
        assert_eq!(image.crop(3, 0, 1, 1), None);
        assert_eq!(image.crop(0, 0, 0, 1), None);
    }

    #[test]
    fn values_are_counted() {
        assert!(Raster::new(2, 2, vec![0; 4]).is_ok());
        for (width, height, found) in [(2, 2, 3), (0, 0, 0), (0, 5, 0)] {
            let image = Raster::new(width, height, vec![0; found]);
            assert!(matches!(image, Err(DataError::Length { .. })));
        }
        assert!(Raster::new(usize::MAX, 2, vec![0; 4]).is_err());
    }
}
