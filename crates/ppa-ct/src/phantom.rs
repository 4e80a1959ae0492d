//! Analytic phantoms built from signed-distance shapes.
