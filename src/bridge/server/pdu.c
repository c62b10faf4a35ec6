/* SPDX-License-Identifier: Apache-2.0 */
#include "server/pdu.h"

#include <string.h>

#define HEADER 7u      /* transaction, protocol, length, unit */
#define LENGTH_BASE 6u /* the header's length counts what follows it: unit and PDU */
#define LENGTH_MIN 2u  /* unit and function */
#define LENGTH_MAX 254u
#define PDU_MAX 253u
#define COIL_ON 0xFF00u
#define ADDRESSES 65536ul

#define MEI_DEVICE_ID 0x0Eu
#define ID_BASIC 1u
#define ID_INDIVIDUAL 4u
#define ID_CONFORMITY 0x82u /* regular objects, by stream and one by one */
#define ID_HEADER 7u
#define ID_BASIC_OBJECTS 3u

static uint16_t get16(const uint8_t *bytes)
{
	return (uint16_t)(bytes[0] << 8 | bytes[1]);
}

static void put16(uint8_t *bytes, uint16_t value)
{
	bytes[0] = (uint8_t)(value >> 8);
	bytes[1] = (uint8_t)value;
}

int db_pdu_cut(const uint8_t *bytes, size_t length)
{
	uint16_t rest;

	if (length >= 4 && get16(bytes + 2) != 0)
		return -1;
	if (length < LENGTH_BASE)
		return 0;
	rest = get16(bytes + 4);
	if (rest < LENGTH_MIN || rest > LENGTH_MAX)
		return -1;
	return length < LENGTH_BASE + rest ? 0 : (int)(LENGTH_BASE + rest);
}

static bool range_fits(uint16_t address, uint16_t count)
{
	return (unsigned long)address + count <= ADDRESSES;
}

/* The parsers below receive the PDU: pdu[0] is the function. */

static uint8_t parse_read(const uint8_t *pdu, size_t length, uint16_t max,
                          struct db_modbus_request *r)
{
	if (length != 5)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	r->read_address = get16(pdu + 1);
	r->read_count = get16(pdu + 3);
	if (r->read_count < 1 || r->read_count > max)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	return range_fits(r->read_address, r->read_count) ? 0 :
	                                                    MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
}

static uint8_t parse_single(const uint8_t *pdu, size_t length, struct db_modbus_request *r)
{
	if (length != 5)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	r->write_address = get16(pdu + 1);
	r->write_count = 1;
	r->value = get16(pdu + 3);
	r->data = pdu + 3;
	if (r->function == MODBUS_FC_WRITE_SINGLE_COIL && r->value != 0 && r->value != COIL_ON)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	return 0;
}

static uint8_t parse_multiple(const uint8_t *pdu, size_t length, struct db_modbus_request *r)
{
	bool bits = r->function == MODBUS_FC_WRITE_MULTIPLE_COILS;
	unsigned max = bits ? MODBUS_MAX_WRITE_BITS : MODBUS_MAX_WRITE_REGISTERS;
	unsigned bytes;

	if (length < 6)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	r->write_address = get16(pdu + 1);
	r->write_count = get16(pdu + 3);
	r->data = pdu + 6;
	bytes = bits ? (r->write_count + 7u) / 8u : r->write_count * 2u;
	if (r->write_count < 1 || r->write_count > max || pdu[5] != bytes || length != 6 + bytes)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	return range_fits(r->write_address, r->write_count) ? 0 :
	                                                      MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
}

static uint8_t parse_write_read(const uint8_t *pdu, size_t length, struct db_modbus_request *r)
{
	unsigned bytes;

	if (length < 10)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	r->read_address = get16(pdu + 1);
	r->read_count = get16(pdu + 3);
	r->write_address = get16(pdu + 5);
	r->write_count = get16(pdu + 7);
	r->data = pdu + 10;
	bytes = r->write_count * 2u;
	if (r->read_count < 1 || r->read_count > MODBUS_MAX_WR_READ_REGISTERS)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	if (r->write_count < 1 || r->write_count > MODBUS_MAX_WR_WRITE_REGISTERS ||
	    pdu[9] != bytes || length != 10 + bytes)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	return range_fits(r->read_address, r->read_count) &&
	                       range_fits(r->write_address, r->write_count) ?
	               0 :
	               MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
}

static uint8_t parse_diagnostic(const uint8_t *pdu, size_t length, struct db_modbus_request *r)
{
	bool known;

	if (length < 3)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	r->diagnostic = get16(pdu + 1);
	r->data = pdu + 3;
	r->data_length = (uint16_t)(length - 3);
	/* Restarting, falling silent and settings of a device on a line are not for a gateway. */
	known = r->diagnostic == DB_DIAGNOSTIC_ECHO ||
	        (r->diagnostic >= DB_DIAGNOSTIC_CLEAR && r->diagnostic <= DB_DIAGNOSTIC_OVERRUNS);
	if (!known)
		return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	if (r->diagnostic == DB_DIAGNOSTIC_ECHO)
		return r->data_length >= 2 && r->data_length % 2 == 0 ?
		               0 :
		               MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	return r->data_length == 2 && get16(r->data) == 0 ? 0 : MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
}

uint8_t db_pdu_parse(const uint8_t *adu, size_t length, struct db_modbus_request *request)
{
	const uint8_t *pdu = adu + HEADER;
	size_t size = length - HEADER;

	*request = (struct db_modbus_request){
		.transaction = get16(adu),
		.unit = adu[6],
		.function = pdu[0],
	};
	switch (request->function) {
	case MODBUS_FC_READ_COILS:
	case MODBUS_FC_READ_DISCRETE_INPUTS:
		return parse_read(pdu, size, MODBUS_MAX_READ_BITS, request);
	case MODBUS_FC_READ_HOLDING_REGISTERS:
	case MODBUS_FC_READ_INPUT_REGISTERS:
		return parse_read(pdu, size, MODBUS_MAX_READ_REGISTERS, request);
	case MODBUS_FC_WRITE_SINGLE_COIL:
	case MODBUS_FC_WRITE_SINGLE_REGISTER:
		return parse_single(pdu, size, request);
	case MODBUS_FC_WRITE_MULTIPLE_COILS:
	case MODBUS_FC_WRITE_MULTIPLE_REGISTERS:
		return parse_multiple(pdu, size, request);
	case DB_FC_DIAGNOSTICS:
		return parse_diagnostic(pdu, size, request);
	case MODBUS_FC_REPORT_SLAVE_ID:
		return size == 1 ? 0 : MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
	case MODBUS_FC_MASK_WRITE_REGISTER:
		if (size != 7)
			return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
		request->write_address = get16(pdu + 1);
		request->write_count = 1;
		request->value = get16(pdu + 3);
		request->or_mask = get16(pdu + 5);
		return 0;
	case MODBUS_FC_WRITE_AND_READ_REGISTERS:
		return parse_write_read(pdu, size, request);
	case DB_FC_DEVICE_ID:
		/* Other interface types count as other functions, whatever their length. */
		if (size >= 2 && pdu[1] != MEI_DEVICE_ID)
			return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
		if (size != 4 || pdu[2] < ID_BASIC || pdu[2] > ID_INDIVIDUAL)
			return MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE;
		request->id_code = pdu[2];
		request->object = pdu[3];
		return 0;
	default:
		return MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
	}
}

void db_pdu_values(const struct db_modbus_request *request, uint16_t *values)
{
	unsigned i;

	switch (request->function) {
	case MODBUS_FC_WRITE_SINGLE_COIL:
		values[0] = request->value != 0;
		break;
	case MODBUS_FC_WRITE_MULTIPLE_COILS:
		for (i = 0; i < request->write_count; i++)
			values[i] = (request->data[i / 8] >> (i % 8)) & 1;
		break;
	default:
		for (i = 0; i < request->write_count; i++)
			values[i] = get16(request->data + 2 * (size_t)i);
		break;
	}
}

/* Completes the header of a frame whose PDU of `length` bytes is in place. */
static size_t finish_frame(const struct db_modbus_request *request, size_t length, uint8_t *adu)
{
	put16(adu, request->transaction);
	put16(adu + 2, 0);
	put16(adu + 4, (uint16_t)(length + 1));
	adu[6] = request->unit;
	return HEADER + length;
}

size_t db_pdu_exception(const struct db_modbus_request *request, uint8_t exception, uint8_t *adu)
{
	adu[HEADER] = request->function | 0x80u;
	adu[HEADER + 1] = exception;
	return finish_frame(request, 2, adu);
}

size_t db_pdu_read(const struct db_modbus_request *request, const uint16_t *values, uint8_t *adu)
{
	bool bits = request->function == MODBUS_FC_READ_COILS ||
	            request->function == MODBUS_FC_READ_DISCRETE_INPUTS;
	size_t count = request->read_count;
	size_t bytes = bits ? (count + 7) / 8 : count * 2;
	uint8_t *pdu = adu + HEADER;

	pdu[0] = request->function;
	pdu[1] = (uint8_t)bytes;
	if (bits) {
		memset(pdu + 2, 0, bytes);
		for (size_t i = 0; i < count; i++)
			pdu[2 + i / 8] |= (uint8_t)((values[i] != 0) << (i % 8));
	} else {
		for (size_t i = 0; i < count; i++)
			put16(pdu + 2 + 2 * i, values[i]);
	}
	return finish_frame(request, 2 + bytes, adu);
}

size_t db_pdu_written(const struct db_modbus_request *request, uint8_t *adu)
{
	uint8_t *pdu = adu + HEADER;

	pdu[0] = request->function;
	put16(pdu + 1, request->write_address);
	switch (request->function) {
	case MODBUS_FC_WRITE_SINGLE_COIL:
	case MODBUS_FC_WRITE_SINGLE_REGISTER:
		put16(pdu + 3, request->value);
		return finish_frame(request, 5, adu);
	case MODBUS_FC_MASK_WRITE_REGISTER:
		put16(pdu + 3, request->value);
		put16(pdu + 5, request->or_mask);
		return finish_frame(request, 7, adu);
	default:
		put16(pdu + 3, request->write_count);
		return finish_frame(request, 5, adu);
	}
}

void db_diagnostics_add(struct db_diagnostics *diagnostics, enum db_diagnostic counter,
                        uint32_t number)
{
	uint16_t *value = &diagnostics->counters[counter - DB_DIAGNOSTIC_BUS_MESSAGES];

	*value = (uint16_t)(*value + number);
}

void db_diagnostics_count_answer(struct db_diagnostics *diagnostics, uint8_t exception)
{
	if (exception != 0)
		db_diagnostics_add(diagnostics, DB_DIAGNOSTIC_EXCEPTIONS, 1);
	if (exception == MODBUS_EXCEPTION_NEGATIVE_ACKNOWLEDGE)
		db_diagnostics_add(diagnostics, DB_DIAGNOSTIC_NAKS, 1);
	if (exception == MODBUS_EXCEPTION_SLAVE_OR_SERVER_BUSY)
		db_diagnostics_add(diagnostics, DB_DIAGNOSTIC_BUSY, 1);
}

size_t db_pdu_diagnostic(const struct db_modbus_request *request,
                         struct db_diagnostics *diagnostics, uint8_t *adu)
{
	uint8_t *pdu = adu + HEADER;
	size_t length = request->data_length;

	pdu[0] = request->function;
	put16(pdu + 1, request->diagnostic);
	if (request->diagnostic >= DB_DIAGNOSTIC_BUS_MESSAGES)
		put16(pdu + 3,
		      diagnostics->counters[request->diagnostic - DB_DIAGNOSTIC_BUS_MESSAGES]);
	else
		memcpy(pdu + 3, request->data, length);
	if (request->diagnostic == DB_DIAGNOSTIC_CLEAR)
		*diagnostics = (struct db_diagnostics){ 0 };
	return finish_frame(request, 3 + length, adu);
}

size_t db_pdu_server_id(const struct db_modbus_request *request, const char *text, size_t length,
                        bool running, uint8_t *adu)
{
	uint8_t *pdu = adu + HEADER;

	if (length > PDU_MAX - 4)
		length = PDU_MAX - 4;
	pdu[0] = request->function;
	pdu[1] = (uint8_t)(length + 2);
	pdu[2] = request->unit;
	pdu[3] = running ? 0xFF : 0x00;
	if (length > 0)
		memcpy(pdu + 4, text, length);
	return finish_frame(request, 4 + length, adu);
}

size_t db_pdu_device_id(const struct db_modbus_request *request,
                        const char *const objects[DB_DEVICE_ID_OBJECTS], uint8_t *adu,
                        uint8_t *exception)
{
	bool single = request->id_code == ID_INDIVIDUAL;
	unsigned end = request->id_code == ID_BASIC ? ID_BASIC_OBJECTS : DB_DEVICE_ID_OBJECTS;
	unsigned first = request->object;
	bool known = first < end && objects[first];
	uint8_t *pdu = adu + HEADER;
	size_t used = ID_HEADER, length;

	*exception = 0;
	if (single && !known) {
		*exception = MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
		return 0;
	}
	pdu[0] = request->function;
	pdu[1] = MEI_DEVICE_ID;
	pdu[2] = request->id_code;
	pdu[3] = ID_CONFORMITY;
	pdu[4] = 0; /* more follows */
	pdu[5] = 0; /* next object */
	pdu[6] = 0; /* objects in this answer */
	if (single)
		end = first + 1;
	/* A stream from an unknown object starts again at the first, as the standard says. */
	for (unsigned id = known ? first : 0; id < end; id++) {
		if (!objects[id])
			continue;
		length = strnlen(objects[id], PDU_MAX - ID_HEADER - 2);
		if (used + 2 + length > PDU_MAX) {
			pdu[4] = 0xFF;
			pdu[5] = (uint8_t)id;
			break;
		}
		pdu[used] = (uint8_t)id;
		pdu[used + 1] = (uint8_t)length;
		memcpy(pdu + used + 2, objects[id], length);
		used += 2 + length;
		pdu[6]++;
	}
	if (pdu[6] == 0) {
		*exception = MODBUS_EXCEPTION_ILLEGAL_FUNCTION;
		return 0;
	}
	return finish_frame(request, used, adu);
}
