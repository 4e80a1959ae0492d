//! Names of the tensors in torchvision and in timm.

/// Returns timm's name of a tensor of its `efficientnet_b0`, given torchvision's.
///
/// timm's `tf_efficientnet_b0` has the same names but another padding and another epsilon in its normalisations;
/// no name distinguishes the two, and its weights do not reproduce its outputs here.
pub fn timm_name(torchvision: &str) -> Option<String> {
    let (module, value) = torchvision.rsplit_once('.')?;
    let module = match module {
        "features.0.0" => "conv_stem".into(),
        "features.0.1" => "bn1".into(),
        "features.8.0" => "conv_head".into(),
        "features.8.1" => "bn2".into(),
        "classifier.1" => "classifier".into(),
        inner => block_name(inner)?,
    };
    Some(format!("{module}.{value}"))
}

/// Converts `features.S.J.block.K...` to `blocks.S-1.J...`; the first stage has no expansion.
fn block_name(module: &str) -> Option<String> {
    let (place, inner) = module.strip_prefix("features.")?.split_once(".block.")?;
    let (stage, block) = place.split_once('.')?;
    let stage = stage.parse::<usize>().ok()?.checked_sub(1)?;
    let inner = match (stage, inner) {
        (0, "0.0") => "conv_dw",
        (0, "0.1") => "bn1",
        (0, "1.fc1") => "se.conv_reduce",
        (0, "1.fc2") => "se.conv_expand",
        (0, "2.0") => "conv_pw",
        (0, "2.1") => "bn2",
        (_, "0.0") => "conv_pw",
        (_, "0.1") => "bn1",
        (_, "1.0") => "conv_dw",
        (_, "1.1") => "bn2",
        (_, "2.fc1") => "se.conv_reduce",
        (_, "2.fc2") => "se.conv_expand",
        (_, "3.0") => "conv_pwl",
        (_, "3.1") => "bn3",
        _ => return None,
    };
    Some(format!("blocks.{stage}.{block}.{inner}"))
}

/// Returns a name without the prefixes of wrappers.
pub fn without_prefix(name: &str) -> &str {
    let mut name = name;
    while let Some(rest) = name
        .strip_prefix("module.")
        .or_else(|| name.strip_prefix("model."))
    {
        name = rest;
    }
    name
}
