//! Tissues of a limb.

/// Tissue at a point of the phantom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Tissue {
    /// Outside the limb.
    Air,
    /// Epidermis and dermis.
    Skin,
    /// Subcutaneous fat, heel pad, Kager's fat.
    Fat,
    /// Muscle, ligament, cartilage and joint fluid.
    SoftTissue,
    /// Achilles tendon.
    Tendon,
    /// Compact bone.
    Cortical,
    /// Spongy bone.
    Trabecular,
    /// Fatty marrow of a shaft.
    Marrow,
    /// Plate and screws.
    Titanium,
}
