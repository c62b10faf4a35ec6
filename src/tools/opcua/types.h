/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The types of the address space: of drives, with one for each family, of values and of events.
 * They are the same on every gateway, so that a client knows them without asking; the nodes of
 * docs/drivebridge.NodeSet2.xml. The rows are written by docs/generate/opcua-types. Independent of
 * the OPC UA library.
 *
 * Pure data.
 */
#ifndef DRIVEBRIDGE_OPCUA_TYPES_H
#define DRIVEBRIDGE_OPCUA_TYPES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The namespace of these nodes. */
#define DB_OPCUA_TYPES_NAMESPACE "urn:drivebridge:types"

enum db_opcua_row_class {
	DB_OPCUA_OBJECT_TYPE_ROW,
	DB_OPCUA_EVENT_TYPE_ROW,
	DB_OPCUA_DATA_TYPE_ROW,
	/* Members of types. */
	DB_OPCUA_OBJECT_ROW,
	DB_OPCUA_VARIABLE_ROW,
	DB_OPCUA_METHOD_ROW,
	/* Properties of a data type: the names of values, of bits. */
	DB_OPCUA_NAMES_ROW,
	DB_OPCUA_BITS_ROW,
	/* ... and of a method. */
	DB_OPCUA_INPUTS_ROW,
	DB_OPCUA_OUTPUTS_ROW,
};

struct db_opcua_type_row {
	const char *id;     /* "DriveType.CommandBlock.Command"; the last part is its name */
	const char *text;   /* its description */
	const char *values; /* of a data type "0=Offline 1=Disabled"; of a method its arguments */
	enum db_opcua_row_class class;
	/* Indexes of rows, -1: none. Of a type the one above it, else the owner; its data type. */
	int16_t above;
	int16_t data;
	uint16_t standard; /* the standard's type above it, or its type definition; 0: none */
	uint8_t basic;     /* of a variable without `data` the standard's data type */
	bool array;
	bool writable;
	bool always; /* each instance has it */
	/* `standard`, and the name, are of OPC UA for Devices. */
	bool devices_type;
	bool devices_name;
};

/* Sorted by their ids. */
extern const struct db_opcua_type_row db_opcua_type_rows[];
extern const size_t db_opcua_type_count;

/* What NamespaceVersion and NamespacePublicationDate (a day of UTC, "2026-11-28") say. */
extern const char db_opcua_types_version[];
extern const char db_opcua_types_date[];

/* The row of this id, which needs no terminating zero; NULL: there is none. */
const struct db_opcua_type_row *db_opcua_type_find(const char *id, size_t length);

/* The type of the drives of a family, "vsmd-serial"; of a family that only a newer service knows
 * that of all drives. */
const struct db_opcua_type_row *db_opcua_type_of_family(const char *family);
const struct db_opcua_type_row *db_opcua_type_of_gateway(void);
const struct db_opcua_type_row *db_opcua_type_of_bus(void);

/* The member "CommandBlock.Command" of a type or of one above it; NULL: it has none. */
const struct db_opcua_type_row *db_opcua_type_member(const struct db_opcua_type_row *type,
                                                     const char *path);

/* True if drives of this type say what they are. */
bool db_opcua_type_has_vendor(const struct db_opcua_type_row *type);

/* The data type that is ours; NULL: it is one of the standard, or there is no row. */
const struct db_opcua_type_row *db_opcua_type_data(const struct db_opcua_type_row *row);

/* True for a data type with names of values, false for one with names of bits. */
bool db_opcua_type_is_enumeration(const struct db_opcua_type_row *data);

/* The last part of the id. */
const char *db_opcua_type_name(const struct db_opcua_type_row *row);

#endif
