//! Methods `with_…` of settings, which other crates cannot construct as struct literals, so that fields can be added without breaking them.

/// Writes methods that take a value by themselves and give back the changed settings.
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
