// Surfaces of rooms whose geometry is known.
#include "tutti/dense/dense_map.h"

#include <gtest/gtest.h>
