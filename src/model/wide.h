// SPDX-License-Identifier: BSD-3-Clause
// Functions compiled for machines that take two, four or eight numbers at once; the sums are the same.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define KURUMAISU_WIDE __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define KURUMAISU_WIDE
#endif
#define KURUMAISU_INLINE inline __attribute__((always_inline))
