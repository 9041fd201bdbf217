#include "test_data.h"
