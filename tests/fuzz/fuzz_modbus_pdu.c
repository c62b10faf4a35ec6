/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A stream of bytes from a client: cut, parse, and answer everything that is well formed. Checks
 * the limits that the server relies on.
 */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "server/pdu.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(bool condition)
{
	if (!condition)
		abort();
}

static void check_answer(const struct db_modbus_request *request, const uint8_t *adu, size_t length)
{
	require(length >= 9 && length <= DB_ADU_MAX);
	require(db_pdu_cut(adu, length) == (int)length);
	require((adu[7] & 0x7F) == (request->function & 0x7F));
}

static void answer(const struct db_modbus_request *request, const uint8_t *frame, size_t length)
{
	static const uint16_t zeros[MODBUS_MAX_READ_BITS];
	const char *objects[DB_DEVICE_ID_OBJECTS] = { 0 };
	uint16_t values[MODBUS_MAX_WRITE_BITS];
	uint8_t adu[DB_ADU_MAX], exception;
	char text[300] = { 0 };
	size_t made;

	require(request->read_count <= MODBUS_MAX_READ_BITS);
	require(request->write_count <= MODBUS_MAX_WRITE_BITS);
	require(request->read_address + request->read_count <= 65536);
	require(request->write_address + request->write_count <= 65536);
	if (request->write_count > 0 && request->function != MODBUS_FC_MASK_WRITE_REGISTER)
		db_pdu_values(request, values);
	if (request->function == MODBUS_FC_REPORT_SLAVE_ID) {
		made = db_pdu_server_id(request, (const char *)frame, length, true, adu);
	} else if (request->function == DB_FC_DIAGNOSTICS) {
		struct db_diagnostics counted = { .counters = { 0 } };

		made = db_pdu_diagnostic(request, &counted, adu);
	} else if (request->function == DB_FC_DEVICE_ID) {
		memcpy(text, frame, length);
		memset(text, 'x', 8);
		for (size_t i = 0; i < DB_DEVICE_ID_OBJECTS; i++)
			objects[i] = (request->transaction >> i & 1) ? text + i * 8 : NULL;
		made = db_pdu_device_id(request, objects, adu, &exception);
		if (made == 0) {
			require(exception == 1 || exception == 2);
			return;
		}
	} else if (request->read_count > 0) {
		made = db_pdu_read(request, zeros, adu);
	} else {
		made = db_pdu_written(request, adu);
	}
	check_answer(request, adu, made);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	uint8_t adu[DB_ADU_MAX], exception, *frame;
	struct db_modbus_request request;
	int length;

	while ((length = db_pdu_cut(data, size)) > 0) {
		require((size_t)length <= size && length >= 8);
		/* A copy of its own, so that reading beyond the frame is found. */
		frame = malloc((size_t)length);
		if (!frame)
			return 0;
		memcpy(frame, data, (size_t)length);
		exception = db_pdu_parse(frame, (size_t)length, &request);
		require(exception <= MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE);
		if (exception)
			check_answer(&request, adu, db_pdu_exception(&request, exception, adu));
		else
			answer(&request, frame, (size_t)length);
		free(frame);
		data += length;
		size -= (size_t)length;
	}
	return 0;
}
