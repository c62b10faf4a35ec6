/* SPDX-License-Identifier: Apache-2.0 */
#include "server/execute.h"

int db_execute_write(const struct db_executor *executor, const struct db_client *client,
                     const struct db_modbus_request *request, struct db_write_token token)
{
	const struct db_backend *backend = executor->backend;
	bool coils = request->function == MODBUS_FC_WRITE_SINGLE_COIL ||
	             request->function == MODBUS_FC_WRITE_MULTIPLE_COILS;
	uint16_t values[MODBUS_MAX_WRITE_BITS];
	uint16_t masked;
	uint8_t exception;

	if (request->function == MODBUS_FC_MASK_WRITE_REGISTER) {
		exception = backend->read(executor->context, client, request->unit,
		                          DB_TABLE_HOLDING, request->write_address, 1, values);
		if (exception)
			return exception;
		masked = (uint16_t)((values[0] & request->value) |
		                    (request->or_mask & ~request->value));
		if (masked == values[0])
			return backend->write_same(executor->context, client, request->unit,
			                           request->write_address, masked, token);
		values[0] = masked;
	} else {
		if (request->function == MODBUS_FC_WRITE_AND_READ_REGISTERS) {
			exception = backend->read(executor->context, client, request->unit,
			                          DB_TABLE_HOLDING, request->read_address,
			                          request->read_count, values);
			/* Other errors (an old value, say) must not prevent a stop. */
			if (exception == MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS)
				return exception;
		}
		db_pdu_values(request, values);
	}
	return backend->write(executor->context, client, request->unit,
	                      coils ? DB_TABLE_COILS : DB_TABLE_HOLDING, request->write_address,
	                      request->write_count, values, token);
}

size_t db_execute_answer(const struct db_executor *executor, const struct db_client *client,
                         const struct db_modbus_request *request, uint8_t *adu, uint8_t *exception)
{
	const struct db_backend *backend = executor->backend;
	uint16_t values[MODBUS_MAX_READ_BITS];
	const char *objects[DB_DEVICE_ID_OBJECTS];
	char text[MODBUS_MAX_PDU_LENGTH];
	enum db_table table = DB_TABLE_HOLDING;
	bool running = false;
	size_t length;

	*exception = 0;
	switch (request->function) {
	case MODBUS_FC_REPORT_SLAVE_ID:
		length = backend->server_id(executor->context, client, request->unit, text,
		                            sizeof(text), &running);
		return db_pdu_server_id(request, text, length, running, adu);
	case DB_FC_DEVICE_ID:
		for (unsigned i = 0; i < DB_DEVICE_ID_OBJECTS; i++)
			objects[i] = backend->device_id(executor->context, client, request->unit,
			                                (uint8_t)i);
		length = db_pdu_device_id(request, objects, adu, exception);
		return *exception ? db_pdu_exception(request, *exception, adu) : length;
	case MODBUS_FC_READ_COILS:
		table = DB_TABLE_COILS;
		break;
	case MODBUS_FC_READ_DISCRETE_INPUTS:
		table = DB_TABLE_DISCRETE;
		break;
	case MODBUS_FC_READ_INPUT_REGISTERS:
		table = DB_TABLE_INPUT;
		break;
	default:
		break;
	}
	if (request->read_count == 0)
		return db_pdu_written(request, adu);
	*exception = backend->read(executor->context, client, request->unit, table,
	                           request->read_address, request->read_count, values);
	return *exception ? db_pdu_exception(request, *exception, adu) :
	                    db_pdu_read(request, values, adu);
}
