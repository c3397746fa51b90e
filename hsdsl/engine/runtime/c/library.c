/* The runtime as this package loads it: also whole runs as one array, many runs at once, and the screen of verdicts. */

#include <stdio.h>

#define HS_MOVES /* exported programs have no verdict, so none of their runs is moved */
#include "hs.c"

#include "pack.c"
#include "ensemble.c"

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("O2")
#endif
#include "screen.c"
