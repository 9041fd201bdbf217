// Functions compiled for plain x86-64 and once more with newer instructions, chosen at run time. None of
// these sets of instructions fuses a multiplication with an addition: results are the same bits. Internal.
#pragma once

// Sanitizers do not get along with the resolvers that choose.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)
#define TUTTI_CLONES(...) __attribute__((target_clones("default", __VA_ARGS__)))
#else
#define TUTTI_CLONES(...)
#endif
