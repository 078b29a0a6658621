//! Enumerations whose variants have names in options, settings and reports.

/// Declares an enumeration of variants `Variant = "name"`, with `ALL`, the variants in order, and the method `name`.
#[doc(hidden)]
#[macro_export]
macro_rules! named {
    ($(#[$meta:meta])* $public:vis enum $Named:ident { $($(#[$of_variant:meta])* $Variant:ident = $name:literal,)+ }) => {
        $(#[$meta])*
        $public enum $Named {
            $($(#[$of_variant])* $Variant,)+
        }

        impl $Named {
            /// All of them, in order.
            $public const ALL: [Self; [$($name),+].len()] = [$(Self::$Variant),+];

            /// The name in options, settings and reports.
            $public fn name(self) -> &'static str {
                match self {
                    $(Self::$Variant => $name,)+
                }
            }
        }
    };
}
