#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| sutura_fuzz::run("trajectory", data));
