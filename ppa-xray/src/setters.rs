//! Methods `with_…` of settings. Other crates cannot construct settings as struct literals, so fields can be added without breaking them.

/// Defines methods that take a value and return the changed settings.
macro_rules! setters {
    ($settings:ident { $($method:ident: $field:ident = $value:ty,)* }) => {
        impl $settings {
            $(
                #[doc = concat!("Sets [`", stringify!($field), "`](Self::", stringify!($field), ").")]
                #[must_use]
                pub fn $method(mut self, $field: $value) -> Self {
                    self.$field = $field.into();
                    self
                }
            )*
        }
    };
}

pub(crate) use setters;
