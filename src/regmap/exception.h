/* SPDX-License-Identifier: Apache-2.0 */
/* Results as Modbus tells them: the one place where the one becomes the other. Pure. */
#ifndef DRIVEBRIDGE_REGMAP_EXCEPTION_H
#define DRIVEBRIDGE_REGMAP_EXCEPTION_H

#include "drivebridge/axis.h"
#include "drivebridge/client.h"
#include "drivebridge/result.h"

#include <stdint.h>

/* The Modbus exception that tells this result; 0 for NONE, OK and UNPROVEN. PENDING is 05. */
uint8_t db_exception_of(enum db_result result);

/* The result that an exception most likely stands for, where nothing else is known. */
enum db_result db_exception_result(uint8_t exception);

/* What db_backend's write returns for it: 0, an exception, or DB_WRITE_LATER. */
int db_exception_of_answer(struct db_write_answer answer);

/* Why a drive cannot be asked: 0B, or 0A when its bus is down. */
uint8_t db_exception_unreachable(const struct db_feedback *feedback);

#endif
