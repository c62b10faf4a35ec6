/* SPDX-License-Identifier: Apache-2.0 */
/* Payloads of Sparkplug B: metrics as bytes. Pure but for memory. */
#ifndef DRIVEBRIDGE_MQTT_PAYLOAD_H
#define DRIVEBRIDGE_MQTT_PAYLOAD_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* By Sparkplug's numbers. */
enum db_mqtt_type {
	DB_MQTT_INT32 = 3,
	DB_MQTT_INT64 = 4,
	DB_MQTT_UINT16 = 6,
	DB_MQTT_UINT32 = 7,
	DB_MQTT_UINT64 = 8,
	DB_MQTT_FLOAT = 9,
	DB_MQTT_DOUBLE = 10,
	DB_MQTT_BOOLEAN = 11,
	DB_MQTT_STRING = 12,
	DB_MQTT_TEMPLATE = 19,
};

enum db_mqtt_quality {
	DB_MQTT_BAD = 0,
	DB_MQTT_GOOD = 192,
	DB_MQTT_STALE = 500,
	DB_MQTT_UNSAID = -1, /* the metric has no property of quality */
};

#define DB_MQTT_NO_ALIAS (-1)

struct db_mqtt_metric {
	const char *name; /* NULL: its alias stands for it */
	int64_t alias;    /* or DB_MQTT_NO_ALIAS */
	int64_t us;       /* of its value, microseconds since 1970-01-01 UTC */
	enum db_mqtt_type type;
	bool typed;          /* the payload tells the type */
	const json_t *value; /* NULL, JSON's null or one of another type: there is none */
	enum db_mqtt_quality quality;
	json_t *properties; /* stays the caller's: an object with texts, numbers and yes or no;
	                       NULL: none */
};

/* Metrics that are collected. Without memory it goes on, and db_mqtt_payload_close() fails. */
struct db_mqtt_payload;

struct db_mqtt_payload *db_mqtt_payload_new(void);
void db_mqtt_payload_add(struct db_mqtt_payload *payload, const struct db_mqtt_metric *metric);

/* The metrics that are added until db_mqtt_payload_end() are members of this one, a template: an
 * instance of the definition with that name, or with NULL a definition. */
void db_mqtt_payload_begin(struct db_mqtt_payload *payload, const struct db_mqtt_metric *metric,
                           const char *definition);
void db_mqtt_payload_end(struct db_mqtt_payload *payload);

/* The bytes of the metrics, to be freed; NULL without memory. Frees the payload, which may be
 * NULL. */
uint8_t *db_mqtt_payload_close(struct db_mqtt_payload *payload, size_t *length);

#define DB_MQTT_NO_SEQ (-1)

/* A whole payload: when it is sent, its number or DB_MQTT_NO_SEQ, and the metrics. To be freed;
 * NULL without memory. */
uint8_t *db_mqtt_payload_finish(int64_t us, int seq, const uint8_t *metrics, size_t metrics_length,
                                size_t *length);

/* The same metrics, marked as historical. To be freed; NULL without memory. */
uint8_t *db_mqtt_payload_mark(const uint8_t *metrics, size_t metrics_length, size_t *length);

/* The type of a register, by its type in the interface of the control socket. */
enum db_mqtt_type db_mqtt_type_of(const char *type);

#endif
