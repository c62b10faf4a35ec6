/* SPDX-License-Identifier: Apache-2.0 */
#include "drivebridge/transport.h"

const struct db_transport *const db_transports[] = {
	&db_transport_serial,
	&db_transport_socketcan,
	&db_transport_slcan,
	NULL,
};
