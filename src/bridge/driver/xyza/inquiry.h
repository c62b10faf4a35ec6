/* SPDX-License-Identifier: Apache-2.0 */
/* Inquiries of XYZA controllers, see driver.h. Pure. */
#ifndef DRIVEBRIDGE_DRIVER_XYZA_INQUIRY_H
#define DRIVEBRIDGE_DRIVER_XYZA_INQUIRY_H

#include "drivebridge/driver.h"

bool xyza_inquire(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                  struct db_exchange *exchange);
enum db_recognised xyza_recognise(const struct db_bus_config *bus, const struct db_inquiry *inquiry,
                                  const uint8_t *frame, size_t length, struct db_inquired *said);

#endif
