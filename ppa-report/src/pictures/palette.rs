//! Colours of the pictures.

use super::canvas::Colour;

pub(super) const PAGE: Colour = [18, 20, 24];
pub(super) const PANEL: Colour = [32, 35, 41];
pub(super) const INK: Colour = [238, 238, 238];
pub(super) const FAINT: Colour = [160, 165, 172];
/// Skin, and its outline in slices.
pub(super) const SKIN: Colour = [222, 188, 160];
pub(super) const OUTLINE: Colour = [70, 215, 255];
pub(super) const AXIS: Colour = [255, 216, 0];
pub(super) const JOINT: Colour = [255, 60, 60];
pub(super) const JOINT_REGION: Colour = [60, 200, 110];
pub(super) const CALF_REGION: Colour = [80, 130, 255];
pub(super) const PLANE: Colour = [255, 140, 30];
/// Faces where the field of view cuts the limb.
pub(super) const CUT: Colour = [255, 0, 200];
/// Where the limb touches the table.
pub(super) const CONTACT: Colour = [90, 235, 90];
pub(super) const TABLE: Colour = [120, 132, 150];
pub(super) const DETECTOR: Colour = [90, 200, 190];
pub(super) const BEAM: Colour = [255, 240, 150];
pub(super) const CAMERAS: [Colour; 2] = [[255, 120, 200], [130, 190, 255]];
pub(super) const SEVERE: Colour = [255, 80, 80];
pub(super) const WARNING: Colour = [255, 200, 60];
pub(super) const GOOD: Colour = [90, 220, 120];
