// Leaks that are not ours, and why: read by the leak sanitizer when a test program begins.

extern "C" const char* __lsan_default_suppressions();

extern "C" const char* __lsan_default_suppressions() {
    // ITK's copy of teem keeps what it had read of a header when it refuses the file.
    return "leak:libITKNrrdIO\n";
}
