/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Passes requests to the backend: the step between the codec and the register map. Stateless;
 * network thread.
 */
#ifndef DRIVEBRIDGE_SERVER_EXECUTE_H
#define DRIVEBRIDGE_SERVER_EXECUTE_H

#include "drivebridge/server.h"
#include "server/pdu.h"

/* The backend on behalf of one client. */
struct db_executor {
	const struct db_backend *backend;
	void *context;
};

/*
 * Hands a write (FC 5, 6, 15, 16, 22, 23) to the backend: 0, an exception, or DB_WRITE_LATER.
 * FC 22 is read, changed and written here. FC 23 is refused with 02 before anything is written when
 * the registers to read do not exist, so that 02 always means that nothing happened.
 */
int db_execute_write(const struct db_executor *executor, const struct db_client *client,
                     const struct db_modbus_request *request, struct db_write_token token);

/*
 * Makes the answer to a request that was not refused: the values are read now. `adu` has room for
 * DB_ADU_MAX bytes. Returns the length; *exception tells what the answer says.
 */
size_t db_execute_answer(const struct db_executor *executor, const struct db_client *client,
                         const struct db_modbus_request *request, uint8_t *adu, uint8_t *exception);

#endif
