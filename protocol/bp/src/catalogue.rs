//! Declarations of events. A name, its meaning, whose it is and its fields stand once; what writes, reads, lists,
//! checks and documents the event follows from there.
//!
//! ```
//! use skein_bp::catalogue::{Declared as _, Events as _, Whose};
//! use skein_bp::Event;
//!
//! skein_bp::words! {
//!     /// Which way a door goes.
//!     pub enum Way { In = "in", Out = "out" }
//! }
//! skein_bp::events! {
//!     /// The events of a door.
//!     pub const DOOR;
//!
//!     /// The door opens.
//!     Open = "open", Anyone {
//!         /// To which side.
//!         way: Way,
//!         /// How wide.
//!         width_m: f64 ["m", 0.0..=2.0],
//!         /// For whom.
//!         guest: Option<String>,
//!     }
//!     /// The door is shut.
//!     Shut = "shut", Own;
//! }
//!
//! let open = Open { way: Way::Out, width_m: 0.8, guest: None }.at("door/1");
//! assert_eq!(open, Event::new("door/1/open").with("way", "out").with("width_m", 0.8));
//! assert_eq!(Open::read(&open).map(|open| open.way), Some(Way::Out));
//! assert!(Open::any_at("door/1").contains(&open) && !Shut::any_at("door/1").contains(&open));
//! assert!(<(Open, Shut)>::any_at("door/1").contains(&open));
//! assert!(Open::way(Way::Out).contains(&open) && !Open::guest("Anna").contains(&open));
//! assert_eq!((DOOR[1].name, DOOR[1].whose), ("shut", Whose::Own));
//! ```

use std::fmt::{self, Display};
use std::ops::RangeInclusive;
use std::sync::Arc;

use crate::event::Event;
use crate::event_set::EventSet;
use crate::value::Value;

/// An event as it is declared.
#[derive(Clone, Debug, PartialEq)]
pub struct Declaration {
    /// The last chunk of its name.
    pub name: &'static str,
    /// Its meaning, in a sentence or two.
    pub about: &'static str,
    pub whose: Whose,
    pub fields: &'static [Field],
}

/// The nodes that have a say in an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Whose {
    /// Its home alone: from afar it is neither requested nor blocked.
    Own,
    /// An operator: it is requested from afar, and enters the home by its gateway; from afar nobody blocks it.
    Operator,
    /// Anyone who has the right to request or to block it.
    Anyone,
}

impl Declaration {
    pub fn field(&self, name: &str) -> Option<&'static Field> {
        self.fields.iter().find(|field| field.name == name)
    }
}

/// A datum of an event as it is declared.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    pub name: &'static str,
    pub about: &'static str,
    pub kind: Kind,
    /// Of a number; empty for others.
    pub unit: &'static str,
    /// The least and the greatest number it may be.
    pub range: Option<RangeInclusive<f64>>,
}

/// The kind of a datum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Flag,
    Whole,
    Number,
    Text,
    Word(&'static [&'static str]),
    /// A datum of this kind, or none.
    Optional(&'static Kind),
}

impl Kind {
    /// Whether an event may have this value in a field of this kind.
    pub fn takes(self, value: &Value) -> bool {
        match self {
            Self::Flag => matches!(value, Value::Bool(_)),
            Self::Whole => value.as_whole().is_some(),
            Self::Number => value.as_number().is_some(),
            Self::Text => matches!(value, Value::Text(_)),
            Self::Word(words) => matches!(value, Value::Text(word) if words.contains(&&**word)),
            Self::Optional(kind) => kind.takes(value),
        }
    }

    pub fn is_number(self) -> bool {
        match self {
            Self::Whole | Self::Number => true,
            Self::Optional(kind) => kind.is_number(),
            Self::Flag | Self::Text | Self::Word(_) => false,
        }
    }
}

impl Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flag => f.write_str("true or false"),
            Self::Whole => f.write_str("whole number"),
            Self::Number => f.write_str("number"),
            Self::Text => f.write_str("text"),
            Self::Word(words) => f.write_str(&words.join(", ")),
            Self::Optional(kind) => write!(f, "{kind}, or none"),
        }
    }
}

/// A type that a declaration belongs to: [`events!`](crate::events) makes it.
pub trait Declared: Sized {
    /// The last chunk of its name.
    const NAME: &'static str = Self::DECLARATION.name;
    const DECLARATION: Declaration;

    /// The event with this data at `node`, its home.
    fn at(self, node: impl Display) -> Event {
        self.write(Event::new(format!("{node}/{}", Self::NAME)))
    }

    /// Puts the data into an event.
    fn write(self, event: Event) -> Event;

    /// The data of an event of this name, whatever its home. `None` if the name is another, or a datum is missing, of
    /// another kind, or out of its range.
    fn read(event: &Event) -> Option<Self>;
}

/// One declared type, or a tuple of several.
pub trait Events {
    /// The last chunks of their names.
    const NAMES: &'static [&'static str];

    /// The events of these names at `node`, whatever their data.
    fn any_at(node: impl Display) -> EventSet {
        EventSet::any_of(Self::NAMES.iter().map(|name| EventSet::named(format!("{node}/{name}"))))
    }

    /// The events of these names at every node that `pattern` fits, such as `uav/*`.
    fn any_of(pattern: &str) -> EventSet {
        EventSet::any_of(Self::NAMES.iter().map(|name| EventSet::from(format!("{pattern}/{name}"))))
    }
}

impl<T: Declared> Events for T {
    const NAMES: &'static [&'static str] = &[T::NAME];
}

macro_rules! tuples_of_events {
    ($(($($name:ident)+))+) => {
        $(impl<$($name: Declared),+> Events for ($($name,)+) {
            const NAMES: &'static [&'static str] = &[$($name::NAME),+];
        })+
    };
}

tuples_of_events! {
    (A B) (A B C) (A B C D) (A B C D E) (A B C D E F) (A B C D E F G) (A B C D E F G H)
}

/// A type that a field may have.
pub trait Datum: Sized {
    const KIND: Kind;
    /// The type of what stands in the field if anything does.
    type Plain: Datum;

    /// `None` leaves the field out.
    fn write(self) -> Option<Value>;

    /// Reads what stands in the field, if anything does.
    fn read(value: Option<&Value>) -> Option<Self>;
}

macro_rules! data {
    ($($type:ty, $kind:expr, |$own:ident| $write:expr, |$value:ident| $read:expr;)+) => {
        $(impl Datum for $type {
            const KIND: Kind = $kind;
            type Plain = Self;

            fn write(self) -> Option<Value> {
                let $own = self;
                Some($write.into())
            }

            fn read(value: Option<&Value>) -> Option<Self> {
                let $value = value?;
                $read
            }
        })+
    };
}

data! {
    bool, Kind::Flag, |flag| flag, |value| value.as_flag();
    i64, Kind::Whole, |whole| whole, |value| value.as_whole();
    // A counter beyond `i64::MAX` is told as that.
    u64, Kind::Whole, |count| i64::try_from(count).unwrap_or(i64::MAX), |value| value.as_whole()?.try_into().ok();
    f64, Kind::Number, |number| number, |value| value.as_number();
    Arc<str>, Kind::Text, |text| text, |value| value.as_text().cloned();
    String, Kind::Text, |text| text, |value| value.as_text().map(|text| text.to_string());
}

/// A datum of another kind than `T` counts as none.
impl<T: Datum> Datum for Option<T> {
    const KIND: Kind = Kind::Optional(&T::KIND);
    type Plain = T::Plain;

    fn write(self) -> Option<Value> {
        self.and_then(T::write)
    }

    fn read(value: Option<&Value>) -> Option<Self> {
        Some(T::read(value))
    }
}

impl Field {
    /// Reads this field of an event as a `T`.
    #[doc(hidden)]
    pub fn read<T: Datum>(&self, event: &Event) -> Option<T> {
        let value = event.get(self.name);
        self.takes_number(value.and_then(Value::as_number)).then(|| T::read(value))?
    }

    /// Whether a number is within the range, if there is one of each.
    pub fn takes_number(&self, number: Option<f64>) -> bool {
        number.zip(self.range.as_ref()).is_none_or(|(number, range)| range.contains(&number))
    }

    /// The values it may have, in words: `number in m, at least 0`.
    pub fn expected(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" in {}", self.unit) };
        let range = match self.range.as_ref().map(|range| (range.start(), range.end())) {
            None => String::new(),
            Some((least, most)) if most.is_infinite() => format!(", at least {least}"),
            Some((least, most)) => format!(", {least} to {most}"),
        };
        match self.kind {
            Kind::Optional(kind) => format!("{kind}{unit}{range}, or none"),
            kind => format!("{kind}{unit}{range}"),
        }
    }
}

#[doc(hidden)]
pub fn with_datum(name: &'static str, datum: impl Datum) -> EventSet {
    datum.write().map_or(EventSet::None, |value| EventSet::field_is(name, value))
}

/// Declares events: a list of them, and for each a type with its data that is [`Declared`]. See [the
/// module](crate::catalogue).
#[macro_export]
macro_rules! events {
    (
        $(#[doc = $list_about:literal])*
        $vis:vis const $list:ident;
        $( $(#[doc = $about:literal])* $name:ident = $text:literal, $whose:ident $body:tt )*
    ) => {
        $(#[doc = $list_about])*
        $vis const $list: &[$crate::catalogue::Declaration] =
            &[$(<$name as $crate::catalogue::Declared>::DECLARATION),*];
        $( $crate::event! { $(#[doc = $about])* $vis $name = $text, $whose $body } )*
    };
}

/// One of [`events!`](crate::events).
#[doc(hidden)]
#[macro_export]
macro_rules! event {
    ($(#[doc = $about:literal])* $vis:vis $name:ident = $text:literal, $whose:ident ;) => {
        $(#[doc = $about])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        $vis struct $name;

        $crate::event! { @declared $name, concat!($($about),*), $text, $whose, }
    };
    (
        $(#[doc = $about:literal])* $vis:vis $name:ident = $text:literal, $whose:ident
        { $($(#[doc = $field_about:literal])* $field:ident: $type:ty $([$unit:literal $(, $range:expr)?])?),+ $(,)? }
    ) => {
        $(#[doc = $about])*
        #[derive(Clone, Debug, PartialEq)]
        $vis struct $name { $($(#[doc = $field_about])* $vis $field: $type),+ }

        #[allow(dead_code)]
        impl $name {
            $(
                #[doc = concat!("The events whose `", stringify!($field), "` is this.")]
                $vis fn $field(value: impl Into<<$type as $crate::catalogue::Datum>::Plain>) -> $crate::EventSet {
                    $crate::catalogue::with_datum(stringify!($field), value.into())
                }
            )+
        }

        $crate::event! {
            @declared $name, concat!($($about),*), $text, $whose,
            $($field, concat!($($field_about),*), $type, concat!("", $($unit)?), [$($($range)?)?];)+
        }
    };
    (
        @declared $name:ident, $about:expr, $text:literal, $whose:ident,
        $($field:ident, $field_about:expr, $type:ty, $unit:expr, [$($range:expr)?];)*
    ) => {
        impl $crate::catalogue::Declared for $name {
            const DECLARATION: $crate::catalogue::Declaration = $crate::catalogue::Declaration {
                name: $text,
                about: $about.trim_ascii(),
                whose: $crate::catalogue::Whose::$whose,
                fields: &[$($crate::catalogue::Field {
                    name: stringify!($field),
                    about: $field_about.trim_ascii(),
                    kind: <$type as $crate::catalogue::Datum>::KIND,
                    unit: $unit,
                    range: $crate::event!(@range $($range)?),
                }),*],
            };

            fn write(self, event: $crate::Event) -> $crate::Event {
                $(
                    let event = match $crate::catalogue::Datum::write(self.$field) {
                        Some(value) => event.with(stringify!($field), value),
                        None => event,
                    };
                )*
                event
            }

            fn read(event: &$crate::Event) -> Option<Self> {
                if event.kind() != Self::NAME {
                    return None;
                }
                #[allow(unused_mut, unused_variables)]
                let mut fields = Self::DECLARATION.fields.iter();
                Some(Self { $($field: fields.next()?.read::<$type>(event)?),* })
            }
        }
    };
    (@range) => { None };
    (@range $range:expr) => { Some($range) };
}

/// Declares the words that a datum may be, as an enumeration that is a [`Datum`](crate::catalogue::Datum).
#[macro_export]
macro_rules! words {
    (
        $(#[$attribute:meta])*
        $vis:vis enum $name:ident { $($(#[$word_attribute:meta])* $variant:ident = $word:literal),+ $(,)? }
    ) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        $vis enum $name { $($(#[$word_attribute])* $variant),+ }

        impl $name {
            /// All of them, in the order of their declaration.
            pub const ALL: &[Self] = &[$(Self::$variant),+];
            /// Their words, in the same order.
            pub const WORDS: &[&str] = &[$($word),+];

            pub const fn word(self) -> &'static str {
                match self { $(Self::$variant => $word),+ }
            }

            pub fn of_word(word: &str) -> Option<Self> {
                match word { $($word => Some(Self::$variant),)+ _ => None }
            }
        }

        impl ::std::fmt::Display for $name {
            fn fmt(&self, f: &mut ::std::fmt::Formatter<'_>) -> ::std::fmt::Result {
                f.pad(self.word())
            }
        }

        impl $crate::catalogue::Datum for $name {
            const KIND: $crate::catalogue::Kind = $crate::catalogue::Kind::Word(Self::WORDS);
            type Plain = Self;

            fn write(self) -> Option<$crate::Value> {
                Some(self.word().into())
            }

            fn read(value: Option<&$crate::Value>) -> Option<Self> {
                Self::of_word(value?.as_text()?)
            }
        }

        impl $crate::serde::Serialize for $name {
            fn serialize<S: $crate::serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.word())
            }
        }

        impl<'de> $crate::serde::Deserialize<'de> for $name {
            fn deserialize<D: $crate::serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let word = <::std::borrow::Cow<'de, str> as $crate::serde::Deserialize>::deserialize(deserializer)?;
                Self::of_word(&word).ok_or_else(|| $crate::serde::de::Error::unknown_variant(&word, Self::WORDS))
            }
        }
    };
}
