/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Modbus TCP frames as the server sees them: bytes to requests, answers to bytes. Pure: no I/O, no
 * clock, no allocation, no state; callable from any thread.
 *
 * Answers are not made with libmodbus' modbus_reply(): it sends at once (so an answer cannot wait
 * for a drive while later ones keep their order), sleeps half a second on a bad quantity and wants
 * a private copy of the whole register map. Its names and limits are used where it has them.
 */
#ifndef DRIVEBRIDGE_SERVER_PDU_H
#define DRIVEBRIDGE_SERVER_PDU_H

#include <modbus.h>

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What libmodbus has no name for. */
#define DB_FC_DIAGNOSTICS 0x08
#define DB_FC_DEVICE_ID 0x2B /* encapsulated interface transport */

#define DB_ADU_MAX ((size_t)MODBUS_TCP_MAX_ADU_LENGTH) /* 7 bytes of header, 253 of PDU */
#define DB_DEVICE_ID_OBJECTS 7u

/*
 * FC 8: what was counted since the beginning, or since counters were cleared; each is the
 * sub-function that reads it. They go on from 0 when they are full.
 */
enum db_diagnostic {
	DB_DIAGNOSTIC_ECHO = 0,   /* no counter: the request comes back */
	DB_DIAGNOSTIC_CLEAR = 10, /* no counter: all become 0 */
	DB_DIAGNOSTIC_BUS_MESSAGES = 11,
	DB_DIAGNOSTIC_BUS_ERRORS = 12, /* frames with a wrong checksum */
	DB_DIAGNOSTIC_EXCEPTIONS = 13,
	DB_DIAGNOSTIC_MESSAGES = 14,   /* requests to units of this gateway, and broadcasts */
	DB_DIAGNOSTIC_NO_ANSWERS = 15, /* those of them that were not answered */
	DB_DIAGNOSTIC_NAKS = 16,       /* answers with exception 07 */
	DB_DIAGNOSTIC_BUSY = 17,       /* answers with exception 06 */
	DB_DIAGNOSTIC_OVERRUNS = 18,   /* frames that were too long to be taken */
};

struct db_diagnostics {
	uint16_t counters[DB_DIAGNOSTIC_OVERRUNS - DB_DIAGNOSTIC_BUS_MESSAGES + 1];
};

/* `counter` is one of those above. */
void db_diagnostics_add(struct db_diagnostics *diagnostics, enum db_diagnostic counter,
                        uint32_t number);

/* An answer was made: 0, or this exception. */
void db_diagnostics_count_answer(struct db_diagnostics *diagnostics, uint8_t exception);

/*
 * One request that passed db_pdu_parse(). Ranges are checked: at least one value, at most what the
 * function allows, and the end is within 65536.
 */
struct db_modbus_request {
	/* Inside the caller's frame. FC 5, 6, 15, 16, 23: values; FC 8: what is echoed. */
	const uint8_t *data;
	uint16_t data_length; /* FC 8 only, bytes */
	uint16_t transaction;
	uint16_t read_address; /* FC 1..4, 23 */
	uint16_t read_count;
	uint16_t write_address; /* FC 5, 6, 15, 16, 22, 23 */
	uint16_t write_count;   /* 0: this request writes nothing */
	uint16_t value;         /* FC 5, 6: on the wire; FC 22: the AND mask */
	uint16_t or_mask;       /* FC 22 */
	uint16_t diagnostic;    /* FC 8: enum db_diagnostic */
	uint8_t unit;
	uint8_t function;
	uint8_t id_code; /* FC 43/14: 1 basic, 2 regular, 3 extended, 4 one object */
	uint8_t object;  /* FC 43/14 */
};

/*
 * The length of the frame at the start of `bytes` (8..260), 0 when it is not complete yet, -1 when
 * this cannot be Modbus TCP. A wrong header is reported as soon as its bytes are there.
 */
int db_pdu_cut(const uint8_t *bytes, size_t length);

/*
 * Reads one frame as cut by db_pdu_cut(). 0, or the exception to answer with: 01 for an unknown
 * function, else 03 for a wrong length, quantity, byte count or value, else 02 for a range that
 * ends beyond 65536. Transaction, unit and function are always filled in.
 */
uint8_t db_pdu_parse(const uint8_t *adu, size_t length, struct db_modbus_request *request);

/* The write_count values of FC 5, 6, 15, 16 and 23 in host order: registers, or 0 and 1. */
void db_pdu_values(const struct db_modbus_request *request, uint16_t *values);

/* Answers. `adu` has room for DB_ADU_MAX bytes; they return the length of the frame. */
size_t db_pdu_exception(const struct db_modbus_request *request, uint8_t exception, uint8_t *adu);

/* FC 1..4 and 23; read_count values in host order, bits as 0 and not 0. */
size_t db_pdu_read(const struct db_modbus_request *request, const uint16_t *values, uint8_t *adu);

/* FC 5, 6, 15, 16 and 22. */
size_t db_pdu_written(const struct db_modbus_request *request, uint8_t *adu);

/* FC 8, with the request's data still in place. Clears the counters when asked to. */
size_t db_pdu_diagnostic(const struct db_modbus_request *request,
                         struct db_diagnostics *diagnostics, uint8_t *adu);

/*
 * FC 17: an id of one byte (the unit), the run indicator, the text. The standard leaves the layout
 * to the device; clients can decode this one. Text beyond 249 bytes is cut off.
 */
size_t db_pdu_server_id(const struct db_modbus_request *request, const char *text, size_t length,
                        bool running, uint8_t *adu);

/*
 * FC 43/14. Objects that the unit does not have are null; texts beyond 244 bytes are cut off.
 * Returns 0 and sets *exception when there are no objects: 02 for an unknown single object, 01 for
 * a unit without any object.
 */
size_t db_pdu_device_id(const struct db_modbus_request *request,
                        const char *const objects[DB_DEVICE_ID_OBJECTS], uint8_t *adu,
                        uint8_t *exception);

#endif
