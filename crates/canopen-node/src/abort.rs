//! SDO abort codes, CiA 301 section 7.2.4.3.17, table 22; any context.

/// Abort code of an SDO transfer. The application may use any other code, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Abort(pub u32);

/// Constants with their description, so that the two cannot differ.
macro_rules! codes {
    ($($(#[$more:meta])* $name:ident = $code:literal, $text:literal;)*) => {
        impl Abort {
            $(#[doc = $text] $(#[$more])* pub const $name: Self = Self($code);)*

            /// CiA's words; empty for a code that is not listed here.
            pub const fn description(self) -> &'static str {
                match self {
                    $(Self::$name => $text,)*
                    _ => "",
                }
            }
        }
    };
}

codes! {
    TOGGLE = 0x0503_0000, "Toggle bit not alternated.";
    TIMEOUT = 0x0504_0000, "SDO protocol timed out.";
    COMMAND = 0x0504_0001, "Client/server command specifier not valid or unknown.";
    BLOCK_SIZE = 0x0504_0002, "Invalid block size.";
    SEQUENCE = 0x0504_0003, "Invalid sequence number.";
    CRC = 0x0504_0004, "CRC error.";
    MEMORY = 0x0504_0005, "Out of memory.";
    ACCESS = 0x0601_0000, "Unsupported access to an object.";
    WRITE_ONLY = 0x0601_0001, "Attempt to read a write only object.";
    READ_ONLY = 0x0601_0002, "Attempt to write a read only object.";
    NO_OBJECT = 0x0602_0000, "Object does not exist in the object dictionary.";
    NOT_MAPPABLE = 0x0604_0041, "Object cannot be mapped to the PDO.";
    PDO_LENGTH = 0x0604_0042, "The number and length of the objects to be mapped would exceed PDO length.";
    INCOMPATIBLE = 0x0604_0043, "General parameter incompatibility reason.";
    HARDWARE = 0x0606_0000, "Access failed due to a hardware error.";
    LENGTH = 0x0607_0010, "Data type does not match, length of service parameter does not match.";
    TOO_LONG = 0x0607_0012, "Data type does not match, length of service parameter too high.";
    TOO_SHORT = 0x0607_0013, "Data type does not match, length of service parameter too low.";
    NO_SUB_INDEX = 0x0609_0011, "Sub-index does not exist.";
    VALUE = 0x0609_0030, "Invalid value for parameter.";
    VALUE_HIGH = 0x0609_0031, "Value of parameter written too high.";
    VALUE_LOW = 0x0609_0032, "Value of parameter written too low.";
    GENERAL = 0x0800_0000, "General error.";
    STORE = 0x0800_0020, "Data cannot be transferred or stored to the application.";
    LOCAL_CONTROL = 0x0800_0021, "Data cannot be transferred or stored to the application because of local control.";
    DEVICE_STATE = 0x0800_0022, "Data cannot be transferred or stored to the application because of the present device state.";
    NO_DATA = 0x0800_0024, "No data available.";
}
