#include "tutti/core/pose.h"
