/// A rigid transform as files hold it: the rows of its 4 x 4 matrix, the last of them `0 0 0 1`, lengths in mm.
pub type TransformRows = [[f64; 4]; 4];
